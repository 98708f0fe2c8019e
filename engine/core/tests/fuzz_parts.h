// What the makers of fuzz_input.h share.
#pragma once
#include <cmath>
#include <limits>

#include "fuzz_input.h"

namespace glint::fuzz {

constexpr double kInf = std::numeric_limits<double>::infinity();
constexpr double kLarge = 0.03;  // the share of meshes and textures that are not small: trees with
                                 // several levels, built on several threads

inline float real(Dice& dice) { return float(dice.number()); }
inline double positive(Dice& dice) { return std::fabs(dice.number()); }

/// Does one of them.
template <class... Ways>
void one_of(Dice& dice, Ways... ways) {
  size_t k = dice.below(sizeof...(ways));
  ((k-- == 0 ? ways() : void()), ...);
}

/// What a scene and an accelerator share.
struct Placed {
  std::vector<GlintGeometry> geometries;
  std::vector<GlintAttribute> attributes;
  std::vector<GlintInstances> instances;
  const double* matrices = nullptr;
  size_t rows = 0;
};
Placed placed(Dice& dice, Arena& arena, size_t materials);

GlintCamera camera(Dice& dice);
GlintTexture texture(Dice& dice, Arena& arena);
/// Materials, with what they read, and media.
void set_materials(Dice& dice, Arena& arena, GlintSceneData& d);

}  // namespace glint::fuzz
