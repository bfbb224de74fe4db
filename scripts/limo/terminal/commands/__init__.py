"""One function that adds each command's arguments, and one that runs it; each imports what it needs when it runs."""
