"""`hil check trust`: what the bench promises, attacked; one row an attack (`page.ALL`)."""
