"""Each message as straight code, written from its declaration: a module for each sender."""
