// What programs ask of the scene (program.h, RayQueries): rays that start at the points of a block.
// They are traced without shading, so that no program runs another one.
#pragma once
#include <vector>

#include "integrator/batch.h"
#include "integrator/plan.h"
#include "scene/scene.h"

namespace glint {

class SceneQueries {
 public:
  SceneQueries(const Scene& scene, const RenderPlan& plan, Scratch& scratch);
  SceneQueries(const SceneQueries&) = delete;
  SceneQueries& operator=(const SceneQueries&) = delete;

  /// Those of one sample. Rays are counted for the points' rows of the batch.
  const RayQueries* at(const Batch& batch, uint32_t sample, RayCounts& counts);

 private:
  /// Some rays of a block, one after the other, and whose they are.
  struct Chosen {
    double column[8][kBlock + kPad];  // o, d, t_min, t_max
    uint32_t from[kBlock + kPad];
    size_t count = 0;
    void add(const AskedRays& rays, uint32_t k);
    Rays rays(uint32_t visibility, const Opacity* opacity) const;
  };

  static void blocked(void* self, const ProgramPoints& points, size_t count, const AskedRays& rays,
                      AskedOf of, uint8_t* blocked);
  void find_blocked(const ProgramPoints& points, size_t count, const AskedRays& rays, AskedOf of,
                    uint8_t* blocked);
  template <class Body>
  void each_choice(const ProgramPoints& points, size_t count, const AskedRays& rays, AskedOf of,
                   Body body);
  void charge(const ProgramPoints& points);

  const Scene& scene_;
  Scratch& scratch_;
  RayQueries queries_{};
  std::vector<uint8_t> alone_;  // a Kind of each instance: clear but the one that is asked about
  Opacity own_{};
  Chosen chosen_{};
  const Batch* batch_ = nullptr;
  RayCounts* counts_ = nullptr;
};

}  // namespace glint
