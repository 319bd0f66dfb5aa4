"""What is done, in order? Functions from artifacts to an artifact."""
