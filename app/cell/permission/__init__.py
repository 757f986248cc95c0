"""May this client do this now, and why not. Pure: values and a time in, a verdict out."""
