// Surfaces as sums of lobes, and the inputs that vary over them.
#pragma once
#include <vector>

#include "glint.h"
#include "math/vec.h"
#include "scene/texture.h"
#include "shading/surface.h"

namespace glint {

class Scene;

/// Kinds of lobes that send rays on.
constexpr uint32_t kPassing = 1u << GLINT_MIRROR | 1u << GLINT_REFRACTION | 1u << GLINT_TRANSPARENT;

inline bool is_fibre(int kind) {
  return kind >= GLINT_FIBRE_DIFFUSE && kind <= GLINT_FIBRE_TRANSMISSION;
}

/// One term of a surface; `k` is final when `constant`.
struct Lobe {
  int kind = GLINT_DIFFUSE;
  int fresnel = 0;  // bits GLINT_DIELECTRIC, GLINT_SCHLICK
  bool constant = true;
  double exponent = 0, ior = 1, masking = 0;
  uint32_t first_input = 0, input_count = 0;
  Vec3d k{1, 1, 1};
  bool like_last = false;  // its inputs are those of the lobe before
  int32_t exponent_slot = 0, masking_slot = 0, ior_slot = 0, fibre_slot = 0;  // as GlintLobe
};

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
};

/// Lobes that light from everywhere, or of matt surfaces, meets at some directions of view more
/// than at others.
inline bool depends_on_view(const Lobe& lobe) {
  return (lobe.kind == GLINT_AMBIENT || lobe.kind == GLINT_DIFFUSE) && lobe.exponent > 0;
}

/// What was read of images at a point, by the number of the read (scene.h): lobes often ask for the
/// same.
struct PointReads {
  static constexpr uint32_t kKept = 8;
  uint32_t count = 0, number[kKept];
  Rgba color[kKept];
  const double* slots = nullptr;  // of the material's program, kBlock apart
};

/// What an input comes to whose value, image and attribute multiply to `product`: with its offset,
/// bounds and complement.
Vec3d of_product(const GlintInput& input, Vec3d product);

/// The product of a lobe's factors at a point of a surface. Finite.
Vec3d coefficient(const Scene& scene, const Lobe& lobe, const Surface& s, PointReads& reads);

/// The ray that meets a surface: where it started, its unit direction and its RayTag.
struct MeetingRay {
  Vec3d start, d;
  int64_t tag;
  RayKind kind;
};

/// The sum of the TRANSPARENT lobes: what goes straight through.
Vec3d transparency(const Scene& scene, const Material& material, const Surface& s,
                   const MeetingRay& ray);

}  // namespace glint
