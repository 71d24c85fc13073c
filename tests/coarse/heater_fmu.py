"""A heated box, from which pythonfmu builds an FMU for the tests and for docs/own_simulator.md."""

from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real


class Heater(Fmi2Slave):
    """Power follows the command; the temperature follows the power and is lost to surroundings of
    20 degrees.
    """

    def __init__(self, **options):
        super().__init__(**options)
        self.command, self.efficiency, self.loss = 0.0, 1.0, 0.005
        self.power, self.celsius = 0.0, 20.0
        self.register_variable(Real("command", causality=Fmi2Causality.input))
        for name in ("efficiency", "loss"):
            self.register_variable(
                Real(name, causality=Fmi2Causality.parameter, variability=Fmi2Variability.tunable)
            )
        for name in ("power", "celsius"):
            self.register_variable(Real(name, causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.power = self.efficiency * self.command
        self.celsius += step_size * (0.1 * self.power - self.loss * (self.celsius - 20.0))
        return True
