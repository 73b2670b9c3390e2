"""The services of `simulation_interfaces`, bound to what the simulator's own services do."""
