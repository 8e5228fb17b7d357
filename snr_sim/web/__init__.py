"""Pages in a browser, served by a running node or over its recorded run."""
