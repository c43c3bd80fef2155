"""The report: one offline page of whatever results a folder holds."""
