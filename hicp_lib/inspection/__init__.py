"""Files and pictures as they are, to look at before any number is computed."""
