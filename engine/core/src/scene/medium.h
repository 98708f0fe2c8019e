// What light passes through, and what encloses it.
#pragma once
#include <cstdint>
#include <vector>

#include "glint.h"
#include "math/vec.h"
#include "program/program.h"
#include "shading/stages.h"

namespace glint {

struct Anchor;
struct InstanceTable;
struct MaterialTable;
struct ProgramTable;

/// What there is at a place, for lengths of anchored space.
struct Matter {
  Vec3d extinction, scattering, emission;
  double anisotropy = 0;
};

/// As GlintMedium has it, for lengths of anchored space.
struct Medium : Matter {
  const ProgramShape* program = nullptr;  // null where it is the same everywhere
  Vec3d absorption;
  int32_t absorption_slot = 0, scattering_slot = 0, emission_slot = 0, anisotropy_slot = 0;
  double step = 1;  // as GlintMedium has it

  bool scatters() const { return scattering_slot > 0 || any(scattering); }
  bool emits() const { return emission_slot > 0 || any(emission); }
};

/// An instance with a medium inside, of which nothing is beyond the box. step: how far apart rays
/// ask the program of one that varies.
struct Enclosure {
  uint32_t instance, medium;
  Vec3d low, high;
  double step;
};

struct MediaTable {
  std::vector<Medium> rows;
  std::vector<Enclosure> enclosures;
  int32_t world = -1;                                    // what is everywhere
  bool scatters = false, emits = false, varies = false;  // some medium of these does
  InstanceShape world_space{};  // the world's axes, as programs read those of an object

  const Medium& operator[](size_t number) const { return rows[number]; }
};

MediaTable place_media(const GlintSceneData& data, const Anchor& anchor,
                       const ProgramTable& programs, const MaterialTable& materials,
                       const InstanceTable& instances);

}  // namespace glint
