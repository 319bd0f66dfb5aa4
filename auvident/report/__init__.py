"""What does a person see? Console tables, figures, HTML."""
