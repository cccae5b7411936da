"""Tables that others read: cutter-location data (APT), contacts, cones, the rows of a batch."""
