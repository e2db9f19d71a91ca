"""From a foreign file to a recording: columns, clock, roles, units and signs; a map of the file drafted and applied."""
