"""An independent multirotor simulator: own equations, own integrator, own sensors."""
