// What programs ask of the scene (program.h, RayQueries): rays from the points of a block. They are
// traced without shading, so that no program runs another one.
#pragma once
#include <vector>

#include "integrator/batch.h"
#include "integrator/columns.h"
#include "integrator/plan.h"
#include "scene/scene.h"

namespace glint {

class SceneQueries {
 public:
  SceneQueries(const Scene& scene, const RenderPlan& plan, const Stages& stages, Scratch& scratch);
  SceneQueries(const SceneQueries&) = delete;
  SceneQueries& operator=(const SceneQueries&) = delete;

  /// Those of one sample. Rays are counted for the points' rows of the batch.
  const RayQueries* at(const Batch& batch, uint32_t sample, RayCounts& counts);

  /// From here on find_crossings is of rays that look for where light comes out of these rows.
  void probe(const Batch& batch, RayCounts& counts);
  /// The place of a hit of the last block, of its number.
  Hit hit(size_t number) const {
    return {columns_[kT][number], instance_[number], primitive_[number], u_[number], v_[number]};
  }

  const Batch& batch() const { return *batch_; }

  /// As RayQueries has them.
  void find_blocked(const ProgramPoints& points, size_t count, const AskedRays& rays, AskedOf of,
                    uint8_t* blocked);
  AskedHits find_nearest(const ProgramPoints& points, size_t count, const AskedRays& rays,
                         AskedOf of);
  AskedHits find_crossings(const ProgramPoints& points, size_t count, const AskedRays& rays);

 private:
  /// Some rays of a block, one after the other, and whose they are.
  struct Chosen {
    double column[8][kBlock + kPad];  // o, d, t_min, t_max
    uint32_t from[kBlock + kPad];
    size_t count = 0;
    void add(const AskedRays& rays, uint32_t k);
    Rays rays(uint32_t visibility, const Opacity* opacity) const;
  };

  template <class Body>
  void each_choice(const ProgramPoints& points, size_t count, const AskedRays& rays, AskedOf of,
                   uint8_t own, Body body);
  void charge(const ProgramPoints& points);
  void add_hit(size_t ray, const Hit& hit);
  AskedHits placed();

  const Scene& scene_;
  const Stages& stages_;
  Scratch& scratch_;
  RayQueries queries_{};
  std::vector<uint8_t> alone_;  // a Kind of each instance: clear but the one that is asked about
  Opacity own_{};
  Chosen chosen_{};
  const Batch* batch_ = nullptr;
  RayCounts* counts_ = nullptr;
  uint64_t* asked_ = nullptr;  // that of these rays
  std::vector<Hit> layers_;    // of the rays of a block
  // Hits of a block: rows, as AskedHits and SurfaceStage have them.
  enum : size_t { kT, kStart, kD = kStart + 3, kX = kD + 3, kG = kX + 3, kN = kG + 3 };
  enum : size_t { kOrigin = kN + 3, kOffset = kOrigin + 3, kWeights, kColumns = kWeights + 2 };
  Columns columns_{kColumns};
  std::vector<uint32_t> point_, instance_, primitive_, material_;
  std::vector<float> u_, v_;
  std::vector<int64_t> outside_;
  size_t hits_ = 0;
};

}  // namespace glint
