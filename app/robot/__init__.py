"""What is known of one robot now: samples, graph, parameters, command status. No I/O."""
