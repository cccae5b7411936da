"""The page: one HTML file that shows a run and needs no network. Contents are gathered by stage, packed, and drawn
in the browser by the scripts in `assets`."""
