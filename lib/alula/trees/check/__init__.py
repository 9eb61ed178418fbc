"""What can be said of files of trees before anything is ticked; nothing here knows of robots."""
