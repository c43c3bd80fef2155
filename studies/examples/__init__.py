"""Short programs that show what magtip does; each is run by a test that checks one number of it."""
