// A wavefront over the rays of one tile and a few samples: closest hits, surfaces, lobes, direct
// light, the rays that go on.
#pragma once
#include <atomic>
#include <vector>

#include "integrator/direct.h"
#include "integrator/first_hit_cache.h"
#include "integrator/layers_ahead.h"
#include "integrator/paths.h"
#include "integrator/photon_map.h"
#include "integrator/scene_queries.h"
#include "integrator/shade.h"
#include "integrator/subsurface.h"

namespace glint {

/// From (x0, y0) to (x1, y1), in pixels.
struct WindowReach {
  double x0, y0, x1, y1;
};

/// One thread's tracer. What a pixel receives, and in which order, depends on that pixel's rays
/// alone: sample after sample, within each generation after generation by age, rays that bounced
/// before those that go straight on. So tiles, regions, threads and how many samples are traced at
/// once do not change a bit.
class Tracer {
 public:
  /// first_hits: to look up the first wave in, and to keep it; null for none.
  Tracer(const Scene& scene, const RenderPlan& plan, Film& film, const std::atomic<bool>& cancel,
         FirstHitCache* first_hits = nullptr);
  Tracer(const Tracer&) = delete;
  Tracer& operator=(const Tracer&) = delete;

  /// `trace` is of this tile from now on, and of those of its pixels that take further samples.
  void choose(const Tile& tile);
  /// Some of the samples from `first` up to `last` of every chosen pixel. Returns how many.
  uint32_t trace(uint32_t first, uint32_t last);
  /// What the rest of the camera rays of these slots of the tile show, after all samples; null of
  /// none. Of the tracer, until it is called again.
  const MoreSeen* see(const Tile& tile, std::vector<uint32_t> slots);
  /// The film's refinement and estimate, for one tile after a wave.
  void measure(const Tile& tile, uint32_t samples);
  void decide(const Tile& tile, uint32_t samples);
  void publish(const Tile& tile, uint32_t samples);
  const RayCounts& counts() const { return counts_; }

 private:
  uint32_t packet_samples(uint32_t samples) const;
  void deal();
  TileFrustum frustum(const Tile& tile) const;
  void start_paths();
  void miss(const Queue& queue);
  /// The material of its rays that hit nothing.
  uint32_t missed(const Queue& queue) const {
    const bool sees_nothing = scene_.world.transparent_film && queue.visibility == kCamera;
    return sees_nothing ? scene_.materials.nothing() : scene_.materials.surroundings();
  }
  void camera_rays();
  void leave_out_unseen(const CameraStage& stage);
  void find_gaps(const Queue& queue);
  uint32_t trace_empty(uint32_t first, uint32_t last);
  void follow_some(const uint32_t* begin, const uint32_t* end, uint32_t first, uint32_t number);
  void follow(uint32_t sample);
  /// A queue on its way through the steps, and rays that leave its surfaces. scattered: gather rays
  /// of media; behind: of other sides.
  struct Wave {
    Queue& queue;
    Queue straight, bounced, glossy, gathering, scattered, behind;
    /// What goes straight on is a mirror's, but for what the camera sees, and gather rays.
    Queue& onward() { return queue.visibility == kCamera || queue.gathers() ? straight : bounced; }
  };
  /// Rays of the camera; of mirrors and glass; those seen blurred; gather rays; and the queues of
  /// `exits`.
  enum Kind : uint32_t {
    kCameraRays = 1,
    kMirrorRays = 2,
    kBlurredRays = 4,
    kGatherRays = 8,
    kExitRays = 16
  };
  struct Step {
    bool wanted;
    uint32_t kinds;  // of rays
    void (*run)(Tracer&, Wave&);
  };
  template <auto run>
  static void on_queue(Tracer& tracer, Wave& wave) {
    (tracer.*run)(wave.queue);
  }
  std::vector<Step> steps() const;
  static uint32_t kind_of(const Queue& queue);
  void follow_queue(Queue& queue);
  /// Of a slot, whose pixels take the same samples of the tables.
  uint32_t class_of(uint32_t slot) const {
    return plan_.interleaving_class(plan_.region.x0 + tile_->x0 + uint32_t(slots_.columns()[slot]),
                                    plan_.region.y0 + tile_->y0 + uint32_t(slots_.rows()[slot]));
  }
  /// Where the camera rays of a slot go in its pixel.
  const double* offsets_of(uint32_t slot) const {
    return plan_.offsets_of(plan_.region.x0 + tile_->x0 + uint32_t(slots_.columns()[slot]),
                            plan_.region.y0 + tile_->y0 + uint32_t(slots_.rows()[slot]));
  }
  void see_some(const uint32_t* begin, const uint32_t* end, uint32_t sample);
  void see_surfaces(Queue& queue, Queue& straight);
  void find_points(const Queue& queue);
  void widen(const Queue& queue);
  void clear_own_light(const Queue& queue);
  void find_pixels(const Queue& queue);
  void bounce(const Queue& queue, Queue& gathering);
  void reflect(Queue& glossy) { direct_.onward.reflect(batch_, sample_, glossy); }
  void scatter(const Queue& queue, Queue& scattered);
  void keep_mesh_normals();
  void add_caustics(const Queue& queue, bool to_parts = true);
  void light_behind(Queue& queue, Queue* gathering);
  void scatter_below(const Queue& queue);
  void show_exits(const Queue& queue);
  void bend_exits(const Queue& queue);
  void keep_gathered(const Queue& queue);
  void find_hits(const Queue& queue);
  void dim(Queue& queue);
  void shade(const Queue& queue, Queue& straight, Queue& bounced);
  void see_lights(size_t k);
  void note_glow(const Queue& queue);
  size_t vary(const Queue& queue, size_t first, size_t count, const Leaving& next);
  EvaluateStage varying(const Queue& queue, const Material& material);
  size_t see_sky(const Queue& queue, size_t first, size_t count);
  const double* run_sky(const Queue& queue, const uint32_t* rows, size_t count);
  /// Whether the camera does not see a point's surface: a catcher of shadows, or a holdout.
  bool is_caught(const Queue& queue, size_t k) const {
    return catches_ && queue.visibility == kCamera &&
           batch_.material[k] < scene_.materials.size() &&
           scene_.instances.group(batch_.instance[k]).flags & (GLINT_CATCHER | GLINT_HOLDOUT);
  }
  bool is_held_out(const Queue& queue, size_t k) const {
    return is_caught(queue, k) && scene_.instances.group(batch_.instance[k]).flags & GLINT_HOLDOUT;
  }
  void set_aside_caught(const Queue& queue);
  void settle_caught(const Queue& queue);
  void keep_caught(const Queue& queue);
  void show_caught();
  Vec3d behind_caught(const Queue& queue, uint32_t k);
  Vec3d take_sums(size_t k);
  void pass_on(const Queue& queue, size_t count, const Leaving& next);
  void cut_holes(const Queue& queue, const uint32_t* rows, size_t count);
  void record(const Queue& queue);
  void note_seen(const Queue& queue);
  void add_guides(const Queue& queue, size_t k, GuideSet set, double share);
  void note_guides(const Queue& queue);
  void note_colors(const Queue& queue);
  void illuminate(const Queue& queue);
  void note_images(const Queue& queue);
  int image_of(const Queue& queue, size_t k, int blurred);
  void note_occlusion(const Queue& queue);
  void note_asked(const Queue& queue);
  void find_asked(const Queue& queue);
  void add_asked(const Queue& queue, double* sums);
  void keep_lighting(const Queue& queue);
  void keep_groups(const Queue& queue);
  void note_aovs(const Queue& queue);
  void note_denoising(size_t k, uint32_t path, double share);
  Vec3d albedo(size_t k) const;
  struct Highlights {
    Vec3d glossy, matt;  // matt: of SHEEN, TOON_DIFFUSE, OREN_NAYAR, FIBRE_DIFFUSE ones
    Vec3d fibre;         // of the glossy, what is of FIBRE ones
  };
  Highlights highlights(size_t k) const;
  size_t note_aovs_of(const Queue& queue, const uint32_t* rows, size_t count);
  void set_aov_points(const Queue& queue, const uint32_t* rows, size_t count,
                      ProgramPoints& points) const;
  void keep_meetings();
  void keep(const Queue& queue);
  void clamp(const Queue& queue);
  void keep_parts(const Queue& queue);
  void wait(Queue queue);
  Queue take(uint32_t visibility, const Queue::Past& past);
  void give(Queue queue);
  uint32_t pixel(const Queue& queue, size_t k) const {
    return slots_.pixel(*tile_, paths_.slot(queue.slot(k)), plan_.region.width());
  }

  const Scene& scene_;
  const RenderPlan& plan_;
  Film& film_;
  const Stages& stages_;
  const std::atomic<bool>& cancel_;
  FirstHitCache* const first_hits_;
  const CameraRays camera_;
  const Shader shader_;
  Scratch scratch_;
  DirectLight direct_;
  std::vector<uint32_t> pixels_;  // of the region, of each of the batch's rays
  SceneQueries queries_;
  Subsurface subsurface_;
  MediaSpans media_;
  std::vector<Vec3d> clear_;  // weights of the batch's rays before media dim them
  RayEnds camera_ends_;       // of camera rays
  bool from_eye_ = false;     // these all begin there, and nothing cuts them
  std::vector<double> ends_;  // of the batch's rays, where media are asked for
  LayersAhead ahead_;
  Batch batch_;
  const WindowReach reach_;   // of all samples
  const bool catches_;        // there are catchers of shadows, or holdouts
  const bool glass_differs_;  // refracted rays see other things than mirrored ones
  const std::vector<Step> steps_;
  const Tile* tile_ = nullptr;
  uint32_t sample_ = 0;        // of the tables
  bool is_first_ = false;      // and of the pixels the first
  bool surely_empty_ = false;  // nothing can be hit in the tile
  SlotTable slots_;
  std::vector<double> program_slots_;  // one program at a time
  std::vector<uint32_t> active_;       // slots that take samples, class by class
  std::vector<uint32_t> class_ends_;   // of each class of pixels, in `active_`
  WindowPoints points_;                // of the samples that are traced now
  Paths paths_;                        // those that are followed now
  Queue first_{kCamera};               // their camera rays
  MoreSeen seen_;
  std::vector<Queue> waiting_, spare_;
  std::vector<PhotonMap::Found> photons_;  // at one point
  PathCuts cuts_;
  RayCounts counts_;
  std::vector<uint32_t> aov_rows_, occlusion_rows_, exit_rows_, exit_materials_;
  std::vector<Vec3d> open_;  // of the latter
  /// A point on a catcher, and what it adds without lights.
  struct Caught {
    uint32_t row;
    Vec3d glow;
  };
  std::vector<Caught> caught_;  // of the batch
  /// What the catchers on a path show: how much of it ends there, what is behind, and their light
  /// with all things there, and without.
  struct CaughtPath {
    Vec3d seen, behind, with, without;
  };
  std::vector<CaughtPath> caught_paths_;  // of each path; none where there are no catchers
  std::vector<int64_t> lit_;              // its `lit` beside them
  std::vector<double> mesh_normals_[3];   // of the batch, where materials bend them
  std::vector<CryptoMeeting> meetings_;   // of the paths that are followed now
};

}  // namespace glint
