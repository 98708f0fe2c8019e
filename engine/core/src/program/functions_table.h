// The elementary functions over arrays, compiled once per instruction set.
#pragma once
#include "program/functions.h"
#include "program/functions_list.h"

namespace glint {
namespace {

/// The first `count` numbers, with ones after them.
inline Doubles load_some(const double* p, size_t count) {
  Doubles some = splat(1);
  for (size_t lane = 0; lane < count && lane < kLanes; ++lane) some[lane] = p[lane];
  return some;
}

template <Doubles (*function)(Doubles, Doubles)>
void apply_binary(const double* x, const double* y, double* out, size_t count) {
  for (size_t k = 0; k < count; k += kLanes) {
    const Doubles result = function(load_some(x + k, count - k), load_some(y + k, count - k));
    for (size_t lane = 0; lane < kLanes && lane < count - k; ++lane) out[k + lane] = result[lane];
  }
}

template <Doubles (*function)(Doubles)>
inline Doubles ignoring_second(Doubles x, Doubles) {
  return function(x);
}
template <Doubles (*function)(Doubles)>
void apply_unary(const double* x, const double*, double* out, size_t count) {
  apply_binary<ignoring_second<function>>(x, x, out, count);
}

constexpr NamedFunction kNamedFunctions[] = {{"exp", apply_unary<exp>},
                                             {"exp2", apply_unary<exp2>},
                                             {"log", apply_unary<log>},
                                             {"log2", apply_unary<log2>},
                                             {"log10", apply_unary<log10>},
                                             {"pow", apply_binary<pow>},
                                             {"sinh", apply_unary<sinh>},
                                             {"cosh", apply_unary<cosh>},
                                             {"tanh", apply_unary<tanh>},
                                             {"sin", apply_unary<sin>},
                                             {"cos", apply_unary<cos>},
                                             {"tan", apply_unary<tan>},
                                             {"asin", apply_unary<asin>},
                                             {"acos", apply_unary<acos>},
                                             {"atan", apply_unary<atan>},
                                             {"atan2", apply_binary<atan2>},
                                             {"floor", apply_unary<floor>},
                                             {"ceil", apply_unary<ceil>},
                                             {"trunc", apply_unary<trunc>},
                                             {"round", apply_unary<round>},
                                             {"fmod", apply_binary<fmod>},
                                             {"floor_mod", apply_binary<floor_mod>},
                                             {nullptr, nullptr}};

}  // namespace
}  // namespace glint
