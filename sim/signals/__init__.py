"""What passes between the parts of the loop at run time, and the trace of it all."""
