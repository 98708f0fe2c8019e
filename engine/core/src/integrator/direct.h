// Light that reaches points straight from the lights: unshadowed terms, shadow rays, and both to
// the sums of a batch (notes 4.12-4.16).
#pragma once
#include <atomic>
#include <vector>

#include "integrator/batch.h"
#include "integrator/lamp_tree.h"
#include "integrator/plan.h"
#include "integrator/scatter_depths.h"
#include "integrator/transmittance.h"
#include "scene/light_program.h"

namespace glint {

/// Many samples of lamps or of media that glow that share the shadow rays of a
/// pixel's sample, and what points get of them all.
struct SharedLight {
  bool on = false;
  std::vector<uint8_t> takes_part;  // of the scene's lights
  bool shows_gloss = false;         // `gloss` is asked for
  uint32_t rays = 0;                // of a point and sample
  std::vector<LampSample> samples;
  LitPoints white, shining;  // the points where samples are asked for shadows, or drawn directions
  std::vector<const Light*> light;  // of each
  std::vector<uint32_t> groups;     // and its light group, the number of these for none
  const int64_t* lit = nullptr;     // mask: points that take part in this sample
  size_t clustered = 0;             // the first of those whose lamps far points see in clusters
  std::vector<LampCluster> clusters;
  std::vector<double> color_sums;              // as ShareStage has them
  std::vector<int64_t> near;                   // mask of points
  std::vector<std::vector<int64_t>> receives;  // masks, of lamps that light but some
  Columns columns{17};
  double *diffuse[3] = {}, *specular[3] = {}, *total = nullptr;  // as ShareStage has them
  double *asked[3] = {}, *passed[3] = {};  // of the samples asked: light, and what got through
  double *ones = nullptr, *gloss[3] = {};
  std::vector<double> given;
  std::vector<uint32_t> reaching;
  std::vector<AskedLamp> chosen, sorted;  // sorted: by sample
  std::vector<uint32_t> ends;             // of each sample's
  std::vector<int64_t> asks;              // mask: points that ask the present sample
  std::vector<uint32_t> place;            // of those among the chosen of the sample
  size_t group_count = 0;                 // with none; 0 where nobody asks
  Columns group_columns{0};               // three of each kind for each group:
  std::vector<double*> group_given, group_asked, group_passed;
};

class DirectLight {
 public:
  DirectLight(const Scene& scene, const RenderPlan& plan, const Stages& stages,
              const std::atomic<bool>& cancel, Scratch& scratch);

  /// Adds all lights to the points of `batch`, for pixel sample `sample`.
  void illuminate(Batch& batch, uint32_t sample, RayCounts& counts) {
    illuminate(batch, sample, batch.queue->past.caught == Queue::Past::kAlone, counts);
  }
  /// The same as if catchers of shadows were the only things there.
  void illuminate_catchers(Batch& batch, uint32_t sample, RayCounts& counts) {
    illuminate(batch, sample, true, counts);
  }
  /// Adds what media before the hits give of themselves to the rays of `batch`, of which `spans`
  /// are. clear: their weights before media dim them.
  void add_glow(Batch& batch, const MediaSpans& spans, const Vec3d* clear);
  /// Adds what they scatter of the lights, and to `gathering` the rays along which light bounced
  /// there. pixels: of the region, of each ray.
  void scatter(Batch& batch, const MediaSpans& spans, const Vec3d* clear,
               const std::vector<uint32_t>& pixels, uint32_t sample, Queue& gathering,
               RayCounts& counts);
  /// Whether lamps are so many that they share the shadow rays of a sample.
  bool shares() const { return lamps_.on; }
  /// What nothing hides within reach of an even sky over each of these points that `illuminate` was
  /// told last: a row of `open` for each, less what things on the way take of it.
  void ambient_occlusion(const Batch& batch, const std::vector<uint32_t>& points, uint32_t sample,
                         std::vector<Vec3d>& open, RayCounts& counts);
  /// Adds to `glossy` the rays that rough surfaces reflect towards others, at the points that
  /// `illuminate` was told last.
  void reflect(const Batch& batch, uint32_t sample, Queue& glossy, RayCounts& counts);
  /// Whether light bounces on at what the rays of a queue meet.
  bool bounces(const Queue& queue) const { return queue.past.bounced < plan_.bounces; }
  /// The same of FIBRE_SPECULAR and FIBRE_TRANSMISSION lobes.
  bool bounces_from_fibres(const Queue& queue) const {
    return queue.past.bounced < plan_.fibre_bounces;
  }
  bool shows_even_gloss(const Queue& queue) const;
  /// Adds to `gathering` the rays along which light came that bounced, to the points that
  /// `illuminate` was told last. pixels: of the region, of each point of the batch.
  void bounce(const Batch& batch, const std::vector<uint32_t>& pixels, uint32_t sample,
              Queue& gathering, RayCounts& counts);

 private:
  void illuminate(Batch& batch, uint32_t sample, bool alone, RayCounts& counts);
  void prepare(const Batch& batch);
  /// Whether point k of a batch is on a strand.
  bool is_on_strand(const Batch& batch, size_t k) const;
  const double* choices(const Batch& batch, const double* const (&at)[RenderPlan::kBounceParts]);
  void send(Path& path, const double* const (&x)[3], uint32_t from, size_t k, Queue& gathering,
            RayCounts& counts) const;
  void push_reflected(const Batch& batch, size_t k, Queue& glossy, RayCounts& counts);
  const Opacity* opacity(const Light& light) const {
    return alone_ ? scene_.trees.opacity_of_catchers(light) : scene_.trees.opacity(light);
  }
  bool find_few(const Batch& batch);
  void add_lights(Batch& batch, uint32_t sample, RayCounts& counts);
  template <class Takes>
  void add_lights(Batch& batch, uint32_t sample, RayCounts& counts, Takes takes);
  const int64_t* find_lit(const Batch& batch, const Light& light);
  LightPolicy policy_of(const Light& light) const;
  OnwardStage onward(const int64_t* lit) const;
  void note_hidden(size_t count, uint32_t parts);
  void add_rest(const Batch& batch, const Light& light, const int64_t* lit, uint32_t sample,
                uint32_t parts);
  void add_lit(const Batch& batch, const Light& light, const LightSample& from, size_t count,
               uint8_t* known, RayCounts& counts);
  void aim_around(const std::vector<uint32_t>& points, const double* place);
  Rays shadow_rays(size_t count) const {
    return {{rays_.o[0], rays_.o[1], rays_.o[2]},
            {rays_.to[0], rays_.to[1], rays_.to[2]},
            zeros_,
            rays_.t_max,
            count,
            kShadow};
  }
  Vec3d start_towards(uint32_t point, const Vec3d& l) const;
  Vec3d shadow_start(uint32_t point, const Vec3d& origin, const Vec3d& end) const;
  size_t meet_emitters(const Light& light, const LampSample& lamp, size_t count, bool matt);
  size_t draw_diffuse(const Batch& batch, const LampSample& lamp);
  void apply_program(const Light& light, size_t count);
  void find_ends(const Batch& batch);
  void place_points(const Batch& batch);
  void scatter_bounce(const Batch& batch, const MediaSpans& spans, const Vec3d* clear,
                      const std::vector<uint32_t>& pixels, uint32_t sample, Queue& gathering,
                      RayCounts& counts);
  void scatter_light(const Batch& batch, const MediaSpans& spans, const Vec3d* clear,
                     const Light& light, uint32_t sample, RayCounts& counts);
  void scatter_sample(const Batch& batch, const MediaSpans& spans, const Vec3d* clear,
                      const Light& light, const LampSample& lamp, double share, double count,
                      RayCounts& counts);
  void dim_shadows(const Light& light, size_t count, RayCounts& counts);
  void find_cut(const Batch& batch, const Light& light, const int64_t* lit) const;
  void find_shadows(const Light& light, size_t count, uint8_t* known, RayCounts& counts);
  bool read_shadow_cache(const uint8_t* known, size_t count);
  void add(const Batch& batch, size_t count) const;
  void split(const Batch& batch, size_t count) const;
  void add_to_groups(const Batch& batch, size_t count) const;
  void find_sharing();
  void share(SharedLight& shared, const Batch& batch, uint32_t sample, RayCounts& counts);
  void list_samples(SharedLight& shared, const Batch& batch, uint32_t sample);
  void list_samples_of(SharedLight& shared, const Light& light, uint32_t sample,
                       const int64_t* lit);
  uint32_t shared_parts(const SharedLight& shared) const;
  bool is_clustered(const Light& light) const;
  const int64_t* receivers(SharedLight& shared, const Batch& batch, const Light& light);
  void choose(SharedLight& shared, const Batch& batch, uint32_t sample);
  void ask(SharedLight& shared, const Batch& batch, size_t number, const AskedLamp* begin,
           const AskedLamp* end, RayCounts& counts);
  void add_shared(const SharedLight& shared, const Batch& batch) const;
  void share_groups(const SharedLight& shared, const Batch& batch, size_t k, Vec3d open) const;

  const Scene& scene_;
  const RenderPlan& plan_;
  const Stages& stages_;
  const std::atomic<bool>& cancel_;
  Scratch& scratch_;
  uint32_t sample_ = 0;
  bool alone_ = false;      // catchers of shadows are the only things there
  bool takes_few_ = false;  // only points that `few_` names are lit
  std::vector<uint8_t> few_;
  std::vector<int64_t> whole_;  // the batch's mask of points that lights may reach
  bool scattering_ = false;     // points are of media and not of surfaces
  const bool glassy_;           // some surface lets light through
  LitPoints points_{};
  ShadowRays rays_{};
  std::vector<uint8_t> place_;   // RenderPlan::bounce_part of each point
  std::vector<double> disc_[2];  // below the direction of the gather ray of each point; in lobes
  std::vector<double> choices_;  // as OnwardStage has them
  Columns columns_;
  double *zeros_ = nullptr, *distance_ = nullptr, *sky_[3] = {},
         *shadow_[3] = {};  // sky_: the rest of a dome; shadow_: S a channel; null where
                            // rays are free or blocked and no more
  double* ends_[3] = {};    // of the shadow segments, where glass or a light's program asks
  LightProgram program_;
  std::vector<uint32_t> point_;
  std::vector<uint8_t> blocked_;
  std::vector<int64_t> linked_;  // mask: points that a light that lights but some may reach
  int group_ = -1;               // of lights, of the present sample
  uint32_t met_by_ = kShadow;    // what its shadow rays meet
  bool met_ = false;             // the present points have met_group_
  std::vector<int> met_group_;   // of what drawn rays meet
  std::vector<uint32_t> emitter_, placement_;  // that drawn rays meet, and their weights there
  std::vector<float> u_, v_;
  std::vector<int32_t> balance_;  // of the batch's points: directions of a dome open less hidden
  TransparentShadows transparent_shadows_;
  MediaSpans media_;
  SharedLight lamps_, glow_;  // glow_: of media
  // Of light that media scatter: where each ray's points lie, their weights, and which there are.
  ScatterDepths depths_;
  Columns scattered_;
  std::vector<double> at_, ends_of_rays_, ends_of_shadows_;
  std::vector<int64_t> scatters_;
  std::vector<MediaSpans::Piece> pieces_;
};

}  // namespace glint
