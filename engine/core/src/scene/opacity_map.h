// Where alpha makes holes in surfaces, known beforehand: rays pass through these without a stop.
#pragma once
#include <map>
#include <vector>

#include "bvh/accel.h"
#include "glint.h"
#include "math/vec.h"
#include "shading/stages.h"

namespace glint {

struct InstanceTable;
struct Scene;

/// Of each square of texels that a lookup reads, whether all of it is 0, or 1: two bits each, which
/// stay in a cache where images do not.
class TexelMap {
 public:
  enum Reading : uint8_t { kMixed = 0, kZero = 1, kOne = 2 };

  /// of_alpha: what is read is the alpha, else all three of the colour.
  TexelMap(const TextureShape& texture, bool of_alpha);
  /// What is read within `off` texels, less than 1, of a coordinate.
  uint8_t around(const double (&at)[2], const double (&off)[2]) const;
  uint32_t size(int axis) const { return axis == 0 ? texture_.width : texture_.height; }

 private:
  struct Span;
  Span span(double x, double off, uint32_t size) const;

  TextureShape texture_;
  std::vector<uint8_t> bits_;
};

/// Of all materials and instances of a scene.
class OpacityMaps {
 public:
  explicit OpacityMaps(const Scene& scene);
  OpacityMaps(const OpacityMaps&) = delete;
  OpacityMaps& operator=(const OpacityMaps&) = delete;
  const Opacity& view() const { return view_; }

 private:
  /// What a material is where the one image that it looks at for its alpha reads 0, or 1.
  struct Known {
    uint8_t always = Opacity::kVaried, at_zero = Opacity::kVaried, at_one = Opacity::kVaried;
    const GlintInput* input = nullptr;  // that looks at it
    const TexelMap* map = nullptr;
  };

  /// The same on the primitives of one slot of a group: also where their UV coordinates are, three
  /// rows a triangle.
  struct Look {
    Known known;
    const uint32_t* rows = nullptr;
    const float* values = nullptr;
    size_t channels = 0;
  };
  /// Of a group of instances. slots: of the primitives; null where there is one look.
  struct Looks {
    const uint16_t* slots;
    uint32_t first, last;
  };

  Known known(uint32_t material);
  Look look(const GlintInstances& group, uint32_t material) const;
  void add_looks(const GlintInstances& group);
  uint8_t where(uint32_t material, uint32_t input, double reading) const;
  bool product(const LobeShape& lobe, uint32_t input, double reading, Vec3d& k) const;
  uint8_t of_group(const Looks& group) const;
  uint8_t at(uint32_t instance, uint32_t primitive, double u, double v) const;

  const Scene& scene_;
  std::map<std::pair<int32_t, bool>, TexelMap> maps_;  // by texture, and whether of its alpha
  std::vector<Known> known_;                           // by material
  std::vector<Look> looks_;
  std::vector<Looks> of_group_;
  std::vector<uint8_t> of_instance_;
  Opacity view_;
};

/// Of a scene for the shadow rays of a light that pass some instances.
class PassedInstances {
 public:
  /// Those of the light sets, and with `catchers_alone` all but catchers.
  /// opacity: of all instances; or null.
  PassedInstances(const InstanceTable& instances, const Opacity* opacity, uint64_t passed_sets,
                  bool catchers_alone);
  PassedInstances(const PassedInstances&) = delete;
  PassedInstances& operator=(const PassedInstances&) = delete;
  const Opacity& view() const { return view_; }

 private:
  std::vector<uint8_t> of_instance_;
  Opacity view_{};
};

}  // namespace glint
