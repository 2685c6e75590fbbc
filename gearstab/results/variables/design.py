"""The variables of the group ``/design``."""

from __future__ import annotations

from gearstab.results.variables import OCCURRENCE, SIDE, TEXT, TONGUE, Variable, coordinate

VARIABLE = coordinate("variable", "variable", TEXT, "1", "what may change")

DESIGN = (
    VARIABLE,
    coordinate("variable_units", "variable", TEXT, "1", "unit of the variable"),
    coordinate("variable_form", "variable", TEXT, "1", "bounds, integers, values or choices"),
    coordinate("objective", "objective", TEXT, "1", "what is minimised"),
    coordinate("state", "state", TEXT, "1", "design: the given one, the optimum"),
    Variable("initial", ("variable",), "f8", "1", "value in the given design"),
    Variable("optimum", ("variable",), "f8", "1", "value in the best design"),
    Variable("initial_text", ("variable",), TEXT, "1", "value in the given design, with the labels of choices"),
    Variable("optimum_text", ("variable",), TEXT, "1", "value in the best design, with the labels of choices"),
    Variable("lower_bound", ("variable",), "f8", "1", "least value allowed"),
    Variable("upper_bound", ("variable",), "f8", "1", "greatest value allowed"),
    Variable("objective_initial", (), "f8", "1", "objective of the given design"),
    Variable("objective_optimum", (), "f8", "1", "objective of the best design"),
    Variable("sensitivity", ("variable",), "f8", "1", "derivative of the objective at the optimum"),
    Variable("margin_lower", ("variable",), "f8", "1", "how far the variable may decrease by itself"),
    Variable("margin_upper", ("variable",), "f8", "1", "how far the variable may increase by itself"),
)
"""Variables of any design. Values stand in the unit that ``variable_units`` says."""

SEVERAL = {"objective_initial": ("objective",), "objective_optimum": ("objective",),
           "sensitivity": ("objective", "variable")}  # fmt: skip
"""Dimensions with several objectives."""

DESIGN_QUANTITIES = (
    coordinate("quantity", "quantity", TEXT, "1", "quantity that designs are judged by"),
    coordinate("quantity_units", "quantity", TEXT, "1", "unit of the quantity"),
    Variable("quantity_value", ("quantity", "state"), "f8", "1", "value of the quantity"),
    coordinate("constraint", "constraint", TEXT, "1", "what is limited"),
    Variable("constraint_value", ("constraint", "state"), "f8", "1", "value of what is limited, the worst of several"),
    Variable("constraint_minimum", ("constraint",), "f8", "1", "lower limit"),
    Variable("constraint_maximum", ("constraint",), "f8", "1", "upper limit"),
)

DESIGN_REGIONS = (
    *TONGUE,
    OCCURRENCE,
    SIDE,
    Variable("range_frequency", ("operating_range", "side", "state"), "f8", "rad/s", "end of the operating range"),
    Variable("range_weight", ("operating_range",), "f8", "1", "weight of the operating range"),
    Variable("region_frequency", ("tongue", "side", "state"), "f8", "rad/s", "mesh frequency at the edge of a region"),
    Variable("region_distance", ("tongue", "state"), "f8", "rad/s", "distance from the operating range to the region"),
    Variable("edge_sensitivity", ("tongue", "side", "state", "variable"), "f8", "1", "derivative of the edge"),
    Variable("edge_sensitivity_first_order", ("tongue", "side", "state", "variable"), "f8", "1",
             "derivative of the edge by first-order theory"),
    coordinate("speed", "speed", "f8", "rad/s", "mesh frequency"),
    Variable("speed_growth_rate", ("speed", "state"), "f8", "1/s", "largest real part of the characteristic exponents"),
    Variable("speed_load_factor", ("speed", "state"), "f8", "1", "largest dynamic load factor of any mesh"),
    Variable("speed_required_damping", ("speed", "state"), "f8", "1", "modal damping ratio that stabilises the system"),
)  # fmt: skip

DESIGN_SCANS = (
    coordinate("place", "place", "f8", "1", "place between the bounds of a variable, from 0 to 1"),
    coordinate("other_place", "other_place", "f8", "1", "place between the bounds of the other variable, from 0 to 1"),
    coordinate("scanned", "scan", TEXT, "1", "variable along place"),
    coordinate("other_scanned", "scan", TEXT, "1", "variable along other_place"),
    Variable("scan_objective", ("scan", "other_place", "place"), "f8", "1",
             "first objective over two variables, all others at the optimum"),
    Variable("step_objective", ("variable", "side"), "f8", "1",
             "first objective with the variable 5 % of its bounds lower or higher, within them"),
    Variable("line_objective", ("variable", "place"), "f8", "1",
             "first objective along one variable, all others at the optimum"),
)  # fmt: skip
"""Variables that describe scans of continuous variables."""

DESIGN_FRONT = (
    coordinate("design", "design", "i4", "1", "number of the design on the front"),
    Variable("design_value", ("design", "variable"), "f8", "1", "value in the design"),
    Variable("design_objective", ("design", "objective"), "f8", "1", "objective of the design"),
    Variable("design_text", ("design",), TEXT, "1", "the design in words"),
)

DESIGN_CHOICES = (
    coordinate("choice", "choice", "i4", "1", "number of the combination of choices, by its objective"),
    Variable("choice_value", ("choice", "variable"), "f8", "1", "value in the combination"),
    Variable("choice_text", ("choice",), TEXT, "1", "the combination in words"),
    Variable("choice_objective", ("choice", "objective"), "f8", "1", "objective of the combination"),
)

DESIGN_PHASING = (
    Variable("phase_step", ("choice",), "i4", "1", "z_s modulo the number of planets"),
    Variable("suppressed", ("choice",), TEXT, "1", "regions within reach that the planets' phases forbid"),
    Variable("driven", ("choice",), TEXT, "1", "regions found within the operating range"),
)
"""Variables of planetary gears with tooth numbers to choose."""
