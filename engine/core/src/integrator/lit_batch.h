// The points of a batch that lights reach, a sample of a light at a time: rays towards it, what
// gets through, and both to the sums (notes 4.12-4.16).
#pragma once
#include <atomic>
#include <vector>

#include "integrator/batch.h"
#include "integrator/media.h"
#include "integrator/plan.h"
#include "integrator/transmittance.h"
#include "scene/light_program.h"

namespace glint {

/// What the light at a thread's rays is found with.
struct LightContext {
  const Scene& scene;
  const RenderPlan& plan;
  const Stages& stages;
  const std::atomic<bool>& cancel;
  Scratch& scratch;
  RayCounts& counts;
};

class LitBatch : public LightContext {
 public:
  explicit LitBatch(const LightContext& context);

  /// For pixel sample `sample`; alone: as if catchers of shadows were the only things there.
  void begin(const Batch& batch, uint32_t sample, bool alone);
  /// Shadow rays tell where they end where glass or a light's program asks.
  void ask_ends(bool asks);
  LightPolicy policy_of(const Light& light) const;
  /// The mask of points that a light may reach, in `mask` unless these are the batch's.
  const int64_t* receivers(const Batch& batch, const Light& light,
                           std::vector<int64_t>& mask) const;
  bool shows_even_gloss(const Queue& queue) const;
  size_t rows() const { return columns_.rows(); }  // of room for rays
  /// Room for rays behind the first `count` of `rays`.
  ShadowRays rays_from(size_t count) const;
  bool is_alone() const { return alone_; }

  /// Adds a sample of a light to the `count` points that `rays` has. known: of the batch's points,
  /// as FirstHitCache::shadows has it, or null.
  void add(const Batch& batch, const Light& light, const LightSample& from, size_t count,
           uint8_t* known);
  /// Notes of the points that light from what is not one point reaches them, and counts their rays.
  void charge(const Batch& batch, size_t count, bool soft, bool casts) const;
  /// Finds what gets through of it. casts: else nothing hides it.
  void trace(const Light& light, LightShape shape, size_t count, bool casts, uint8_t* known);
  /// What `trace` found of row k.
  Vec3d open(size_t k) const {
    return shadow_[0] ? row(shadow_, k) : blocked_[k] ? Vec3d{} : Vec3d{1, 1, 1};
  }
  /// Whether anything hides row k's light from its point, or dims it. Where shadows have colours,
  /// `open` of what has no light may be that of an earlier sample.
  bool is_dimmed(size_t k) const;
  /// What nothing hides within reach of an even sky over each of these points: a row of `sky` for
  /// each, less what things on the way take of it.
  void ambient_occlusion(const Batch& batch, const std::vector<uint32_t>& at, uint32_t sample,
                         std::vector<Vec3d>& sky);
  Rays shadow_rays(size_t count) const {
    return {{rays.o[0], rays.o[1], rays.o[2]},
            {rays.to[0], rays.to[1], rays.to[2]},
            zeros_,
            rays.t_max,
            count,
            kShadow};
  }
  /// Where the shadow ray along l of a point leaves the surface, as stage_terminator.h has it; and
  /// where the one starts that leaves it at `origin` and ends at `end`, as stage_light.h does.
  Vec3d start_towards(uint32_t point, const Vec3d& l) const;
  Vec3d shadow_start(uint32_t point, const Vec3d& origin, const Vec3d& end) const;

  /// The ray along which light came from o + t l to `start`, by way of what scatters a path.
  void push_gather_ray(Path path, Vec3d start, Vec3d o, Vec3d l, Queue& gathering) const;

  LitPoints points{};
  ShadowRays rays{};
  // Of the present sample of a light:
  int group = -1;                 // of lights
  const int* groups = nullptr;    // of each row in place of that; or null
  uint32_t visibility = kShadow;  // what its shadow rays meet
  bool hides = true;              // else nothing is in lights' way
  bool scattering = false;        // points are of media and not of surfaces

 private:
  void find_shadows(const Light& light, size_t count, uint8_t* known);
  bool read_shadow_cache(const uint8_t* known, size_t count);
  void dim_shadows(const Light& light, size_t count);
  void apply_program(const Light& light, size_t count);
  void add_to_sums(const Batch& batch, size_t count) const;
  void add_to_groups(const Batch& batch, size_t count) const;
  void split(const Batch& batch, size_t count) const;
  void aim_around(const std::vector<uint32_t>& at, const double* place);
  const Opacity* opacity(const Light& light) const {
    return alone_ ? scene.trees.opacity_of_catchers(light) : scene.trees.opacity(light);
  }

  const bool glassy_;  // some surface lets light through
  uint32_t sample_ = 0;
  bool alone_ = false;
  Columns columns_;
  double *zeros_ = nullptr, *ends_[3] = {},
         *shadow_[3] = {};  // S a channel; null where rays are free or blocked and no more
  std::vector<uint32_t> point_;
  std::vector<uint8_t> blocked_;
  std::vector<double> ends_of_shadows_;
  LightProgram program_;
  TransparentShadows transparent_shadows_;
  MediaSpans media_;
};

}  // namespace glint
