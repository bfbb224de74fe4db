"""What turns a model into frames and a status."""
