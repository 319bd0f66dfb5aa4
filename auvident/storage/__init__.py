"""Where is it kept? Log readers, run directory, declared files."""
