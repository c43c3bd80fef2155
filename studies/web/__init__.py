"""Pages: the explorer, whose sensor changes by hand, its export as one file, and the report of folders of results."""
