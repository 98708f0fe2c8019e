// The node programs of a scene, and the world, which may have one.
#pragma once
#include <cmath>
#include <vector>

#include "glint.h"
#include "math/vec.h"
#include "program/program.h"

namespace glint {

struct ProgramTable {
  std::vector<ProgramShape> rows;
  uint32_t most_slots = 0;
  bool asks_rays = false;  // some program does
  std::vector<int32_t> words;
  std::vector<double> constants, tables;

  /// By its number in glint.h, which counts from 1; null for 0.
  const ProgramShape* of(int32_t number) const {
    return number > 0 ? &rows[size_t(number - 1)] : nullptr;
  }
};

ProgramTable copy_programs(const GlintSceneData& data);

/// How much mist lies before what is at some distance from the eye.
struct Mist {
  double start = 0, per_length = 0;
  int falloff = GLINT_MIST_LINEAR;
  double at(double distance) const {
    const double x = std::fmin(std::fmax((distance - start) * per_length, 0), 1);
    return falloff == GLINT_MIST_QUADRATIC ? x * x
           : falloff == GLINT_MIST_LINEAR  ? x
                                           : std::sqrt(x);
  }
};

/// What is there where rays hit nothing, and what lies over everything.
struct World {
  Vec3d ambient, background;
  bool transparent_film = false;
  Mist mist;
  double occlusion_distance = 0;              // in world units
  int light_group = -1;                       // of the surroundings; -1 for none
  const ProgramShape* sky_program = nullptr;  // what rays see that hit nothing; null: background
  size_t sky_slot = 0;                        // in the block of its slots
  Vec3d sky_axes[3];                          // its axes in the scene
};

World world_of(const GlintSceneData& data, const ProgramTable& programs);

/// Channels that are not finite become 0, others at most 1e100.
Vec3d finite_color(const double* c);

}  // namespace glint
