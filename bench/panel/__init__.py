"""The panel: a page beside a running engine that shows every signal and gives every command."""
