"""How near the tool and the machine's own bodies come to what is never cut."""
