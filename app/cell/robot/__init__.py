"""The current state of one robot: samples, graph, parameters, command status. No I/O."""
