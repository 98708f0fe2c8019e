// Surfaces as sums of lobes.
#pragma once
#include "glint.h"
#include "math/vec.h"
#include "shading/stages.h"

namespace glint {

/// Kinds of lobes that send rays on.
constexpr uint32_t kPassing = 1u << GLINT_MIRROR | 1u << GLINT_REFRACTION | 1u << GLINT_TRANSPARENT;

inline bool is_fibre(int kind) {
  return kind >= GLINT_FIBRE_DIFFUSE && kind <= GLINT_FIBRE_TRANSMISSION;
}

struct Material {
  uint32_t first_lobe = 0, lobe_count = 0;
  int32_t index = 0, program = 0, normal = 0;  // as GlintMaterial has them
  uint32_t crypto = 0;
  int32_t aov = 0, medium = 0, bump_shadowing = 0, base_normal = 0;
  uint32_t kinds = 0;  // bit 1 << kind for each of its lobes
  int specular_count = 0, view_count = 0;
  int passing = 0;  // lobes that send rays on, unless all of these are nothing
  bool is_rough_glass = false;
  bool has(int kind) const { return kinds >> kind & 1; }
  /// Whether normals of the lobe are lifted so far that mirrors see nothing below the surface.
  bool lifts(const LobeShape& lobe) const {
    const bool shiny = lobe.kind == GLINT_SPECULAR
                           ? lobe.masking > 0
                           : lobe.kind == GLINT_MIRROR || lobe.kind == GLINT_REFRACTION;
    return shiny && program > 0 && bump_shadowing >= GLINT_BUMP_CHIANG;
  }
};

/// Lobes that light from everywhere, or of matt surfaces, meets at some directions of view more
/// than at others.
inline bool depends_on_view(const LobeShape& lobe) {
  return (lobe.kind == GLINT_AMBIENT || lobe.kind == GLINT_DIFFUSE) && lobe.exponent > 0;
}

/// Of a lobe that does not vary.
inline Vec3d coefficient(const LobeShape& lobe) { return {lobe.k[0], lobe.k[1], lobe.k[2]}; }

/// What an input comes to whose image, attribute and program multiply to `read`: that times its
/// value, with its offset, bounds and complement. Finite.
Vec3d factor_of(const GlintInput& input, double read = 1);

}  // namespace glint
