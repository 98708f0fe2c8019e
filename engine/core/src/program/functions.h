// The elementary functions of numbers in double over lanes, from + - * /, square roots, comparisons
// and integers: the same bits from every instruction set (of NaN, no particular ones). Errors are
// in units of the last place of the result, tested against mpmath.
#pragma once
#include "program/functions_exp.h"
#include "program/functions_hyperbolic.h"
#include "program/functions_round.h"
#include "program/functions_trig.h"
