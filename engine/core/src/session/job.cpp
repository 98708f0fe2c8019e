#include "session/job.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "math/math.h"
#include "session/timer.h"

namespace glint {
namespace {

constexpr uint32_t kUnseenWave =
    16;  // of samples: long enough for packets, short enough to be cancelled

<<<<<<< HEAD
int threads_for(uint32_t wanted) {
  uint32_t cores = std::max(1u, std::thread::hardware_concurrency());
  return int(std::min(wanted ? wanted : cores, kMaxThreads));
}

/// The region with the pixels next to it.
Region widened(Region r, const GlintCamera& camera) {
  return {r.x0 - (r.x0 > 0), r.y0 - (r.y0 > 0), std::min(r.x1 + 1, camera.width),
          std::min(r.y1 + 1, camera.height)};
}

/// The openings of a dome in anchored space.
void add_openings(RenderPlan& plan, const GlintRenderSettings& g, const Anchor& anchor) {
  const double ratio = double(g.opening_samples) / plan.dome_samples;
  std::vector<Opening> rows(g.openings ? g.opening_count : 0);
  for (size_t i = 0; i < rows.size(); ++i) {
    const double* const row = g.openings + 13 * i;
    Opening& on = rows[i];
    const Vec3d center = anchor.point({row[0], row[1], row[2]}),
                right = anchor.scale * Vec3d{row[3], row[4], row[5]},
                up = anchor.scale * Vec3d{row[6], row[7], row[8]};
    for (int c = 0; c < 3; ++c) {
      on.center[c] = center[c];
      on.right[c] = right[c];
      on.up[c] = up[c];
      on.across[c] = right[c] / dot(right, right);
      on.along[c] = up[c] / dot(up, up);
      on.normal[c] = row[9 + c];
    }
    on.density = ratio * row[12] / (4 * length(right) * length(up));
  }
  if (rows.empty()) return;
  plan.opening_samples = g.opening_samples;
  plan.opening_tabled = uint32_t(std::max(g.opening_point_count / g.opening_samples, uint64_t(1)));
  plan.opening_points = g.opening_points;
  plan.opening_rows = std::make_shared<const std::vector<Opening>>(std::move(rows));
  plan.open = {plan.opening_rows->data(), plan.opening_rows->size()};
}

RenderPlan plan_of(const GlintRenderSettings& g, const Scene& scene) {
  const GlintCamera& camera = scene.camera;
  RenderPlan plan;
  plan.shown = plan.region = {g.region[0], g.region[1], g.region[2], g.region[3]};
  const bool refines = g.error_threshold > 0 || g.passes >> GLINT_PASS_ERROR & 1;
  if (refines && g.samples >= Refinement::kFirst) plan.region = widened(plan.shown, camera);
  plan.error_threshold = g.error_threshold;
  plan.cutoff = g.cutoff;
  plan.samples = g.samples;
  plan.light_samples = g.light_samples;
  plan.lamp_shadows = g.lamp_shadows;
  plan.max_bounces = g.max_bounces;
  plan.passes = g.passes;
  plan.crypto_ids = g.crypto_ids;
  plan.unseen = g.waves == GLINT_WAVES_UNSEEN;
  plan.hold_waves = g.waves == GLINT_WAVES_HELD;
  plan.threads = threads_for(g.threads);
  plan.quality = BuildQuality(g.acceleration);
  plan.physical = g.illumination == GLINT_PHYSICAL;
  plan.remember = g.remember != 0;
  plan.moving = g.moving != 0;
  plan.pixel_offsets = g.pixel_offsets;
  plan.light_square = g.light_square;
  plan.light_disc = g.light_disc;
  plan.dome_samples = std::max(g.dome_samples, 1u);
  plan.dome_tabled = uint32_t(std::max(g.dome_count / plan.dome_samples, uint64_t(1)));
  plan.dome_table = g.dome_table;
  plan.mesh_samples = std::max(g.mesh_samples, 1u);
  plan.mesh_tabled = uint32_t(std::max(g.mesh_count / plan.mesh_samples, uint64_t(1)));
  plan.mesh_table = g.mesh_table;
  plan.mesh_rows = size_t(g.mesh_count);
  plan.bounced_samples = std::max(g.bounced_samples, 1u);
  plan.bounced_tabled = uint32_t(std::max(g.bounced_count / plan.bounced_samples, uint64_t(1)));
  plan.bounced_table = g.bounced_table;
  plan.bounced_shadows = std::clamp(g.bounced_shadows, 1u, plan.bounced_samples);
  plan.lobe_points = g.lobe_points;
  plan.lobe_levels = std::max(g.lobe_levels, 1u);
  plan.lobe_tabled = std::max(size_t(g.lobe_count) / plan.lobe_levels, size_t(1));
  plan.reflections = g.reflections;
  plan.dome.cells = g.dome_cells;
  plan.dome.rows = g.dome_rows;
  plan.dome.columns = g.dome_columns;
  plan.dome.irradiance = g.dome_irradiance;
  plan.dome.irradiance_rows = g.dome_irradiance_rows;
  plan.dome.irradiance_columns = g.dome_irradiance_columns;
  plan.volume_samples = g.volume_samples;
  plan.scatter_offsets = g.scatter_offsets;
  plan.lens_points = g.lens_points;
  plan.camera_frames = g.camera_frames;
  plan.camera_block = g.camera_block;
  plan.neighbours = g.neighbours;
  plan.occlusion_points = g.occlusion_points;
  plan.occlusion_samples = std::max(g.occlusion_samples, 1u);
  plan.occlusion_tabled =
      uint32_t(std::max(g.occlusion_count / plan.occlusion_samples, uint64_t(1)));
  plan.node_points = g.node_points;
  plan.node_point_count = g.node_point_count;
  plan.lens_focus = g.lens_focus;
  plan.gather_reach = scene.anchor.scale * g.gather_reach;
  plan.gather_points = g.gather_points;
  plan.gather_samples = std::max(g.gather_samples, 1u);
  plan.gather_block = std::max(g.gather_block, 1u);
  plan.gather_tabled = uint32_t(std::max(g.gather_count / plan.gather_samples, uint64_t(1)));
  add_openings(plan, g, scene.anchor);
  for (int k = 0; k < 9; ++k) plan.dome.axes[k / 3][k % 3] = g.dome_axes[k];
  return plan;
}

=======
>>>>>>> main
bool same_view(const GlintCamera& a, const GlintCamera& b) {
  const bool same_planes = a.clip_plane_count == b.clip_plane_count &&
                           std::memcmp(a.clip_planes, b.clip_planes, sizeof a.clip_planes) == 0;
  const size_t first = offsetof(GlintCamera, longitude);
  const bool same_panorama =
      a.kind != GLINT_PANORAMA ||
      std::memcmp(reinterpret_cast<const char*>(&a) + first,
                  reinterpret_cast<const char*>(&b) + first, sizeof a - first) == 0;
  return a.width == b.width && a.height == b.height && a.kind == b.kind && same_planes &&
         same_panorama && a.clip_start == b.clip_start && a.clip_end == b.clip_end &&
         std::equal(a.window, a.window + 4, b.window) &&
         std::equal(a.world_from_camera, a.world_from_camera + 12, b.world_from_camera);
}

<<<<<<< HEAD
bool sound_region(const uint32_t* r, const GlintCamera& camera) {
  return r[0] < r[2] && r[1] < r[3] && r[2] <= camera.width && r[3] <= camera.height;
}

bool enough_directions(const GlintRenderSettings& g, const Scene& scene) {
  if (!(scene.features & GLINT_FEATURE_WORLD_LIGHT)) return true;
  return g.dome_samples >= 1 && g.dome_table && g.dome_cells && g.dome_rows >= 1 &&
         g.dome_columns >= 1 && g.dome_irradiance && g.dome_irradiance_rows >= 1 &&
         g.dome_irradiance_columns >= 1 && g.dome_count >= g.dome_samples;
}

bool sound_openings(const GlintRenderSettings& g) {
  if (!g.openings) return true;
  if (g.opening_count < 1 || g.opening_count > 256 || g.opening_samples < 1 ||
      g.opening_samples > 1u << 16 || !g.opening_points ||
      g.opening_point_count < g.opening_samples)
    return false;
  for (uint64_t i = 0; i < 13 * g.opening_count; ++i)
    if (!std::isfinite(g.openings[i])) return false;
  for (uint64_t i = 0; i < 3 * g.opening_point_count; ++i) {
    const double at = g.opening_points[i], most = i % 3 ? 1 : double(g.opening_count - 1);
    if (!(at >= (i % 3 ? -1 : 0) && at <= most)) return false;
  }
  return true;
}

bool enough_mesh_points(const GlintRenderSettings& g, const Scene& scene) {
  return !(scene.features & GLINT_FEATURE_MESH_LIGHT) ||
         (g.mesh_samples >= 1 && g.mesh_table && g.mesh_count >= g.mesh_samples);
}

bool enough_bounced_points(const GlintRenderSettings& g, const Scene& scene) {
  return !(scene.features & GLINT_FEATURE_BOUNCED_LIGHT) ||
         (g.bounced_samples >= 1 && g.bounced_table && g.bounced_count >= g.bounced_samples &&
          g.gather_reach >= 0 && g.gather_reach < kInfinity &&
          (g.gather_reach == 0 ||
           (g.gather_points && g.gather_samples >= 1 && g.gather_samples <= 64 &&
            g.gather_block >= 1 && g.gather_block <= 8 && g.gather_count >= g.gather_samples)));
}

bool enough_offsets(const GlintRenderSettings& g, const Scene& scene) {
  return !scene.media.scatters || (g.volume_samples >= 1 && g.volume_samples <= 1u << 12 &&
                                   g.scatter_offsets && g.scatter_count >= g.samples);
}

bool enough_camera_rows(const GlintRenderSettings& g) {
  const uint64_t block = g.camera_block;
  const auto enough = [&](const double* table, uint64_t count) {
    return !table || (block >= 1 && block <= 1u << 12 && count / (block * block) >= g.samples);
  };
  return enough(g.lens_points, g.lens_point_count) && (!g.lens_points || g.lens_focus > 0) &&
         enough(g.camera_frames, g.camera_frame_count);
}

bool enough_occlusion(const GlintRenderSettings& g) {
  return !(g.passes >> GLINT_PASS_AMBIENT_OCCLUSION & 1) ||
         (g.occlusion_samples >= 1 && g.occlusion_points &&
          g.occlusion_count >= g.occlusion_samples);
}

bool sound_neighbours(const GlintRenderSettings& g, const Scene& scene) {
  if (!g.neighbours || !(g.passes >> GLINT_PASS_VECTOR & 1)) return true;
  size_t rows = 0;
  for (const GlintInstances& group : scene.instances.groups)
    rows = std::max(rows, size_t(group.first_row + group.row_count));
  for (int k = 0; k < 2; ++k) {
    const GlintNeighbour& n = g.neighbours[k];
    if (n.camera.kind != scene.camera.kind || n.row_count < rows ||
        n.shape_count != scene.instances.geometries.size() || (rows && !n.world_from_object) ||
        (n.shape_count && !n.shapes))
      return false;
    for (size_t i = 0; i < n.shape_count; ++i)
      if (n.shapes[i].vertices &&
          (scene.instances.geometries[i].kind == GLINT_POLYGONS ||
           n.shapes[i].vertex_count != scene.instances.geometries[i].vertex_count))
        return false;
  }
  return true;
}

bool enough_points(const GlintRenderSettings& g, const Scene& scene) {
  if (g.light_samples <= 1 || !(scene.features & GLINT_FEATURE_SOFT_LIGHTS)) return true;
  return g.light_square && g.light_disc && g.light_point_count / g.light_samples >= g.samples;
}

=======
>>>>>>> main
}  // namespace

Job::Job(Scene& scene, const GlintRenderSettings& settings)
    : scene_(&scene),
      plan_(settings, scene),
      film_(plan_.region, plan_.shown, plan_.passes, plan_.error_threshold, plan_.light_samples,
            plan_.crypto_ids, scene.aov_count, scene.light_group_count),
      thread_([this] { work(); }) {}

Job::~Job() {
  cancel();
  thread_.join();
}

void Job::enter(int state) {
  std::lock_guard lock(mutex_);
  if (!ended()) state_ = state;
  built_ = built_ || state == GLINT_TRACING;
  changed_.notify_all();
}

void Job::fail(const char* what) {
  cancel_ = true;
  std::lock_guard lock(mutex_);
  if (!ended()) {
    state_ = GLINT_FAILED;
    error_ = what;
  }
  changed_.notify_all();
}

/// The thread of the job: nothing is thrown beyond it.
void Job::work() {
  try {
    run();
  } catch (const std::bad_alloc&) {
    fail("out of memory");
  } catch (const std::exception& e) {
    fail(e.what());
  }
}

void Job::run() {
  if (!scene_->build(plan_.thread_count, BuildQuality(plan_.acceleration), cancel_))
    return enter(GLINT_CANCELLED);
  moving_seconds_ = scene_->trees.build_seconds();
  enter(GLINT_TRACING);
  trace_waves();
  enter(cancel_ ? GLINT_CANCELLED : GLINT_DONE);
}

/// Samples of the first wave: no more than somebody wants to look at.
uint32_t Job::first_wave() {
  if (plan_.waves != GLINT_WAVES_UNSEEN || film_.estimate().on()) return 1;
  return std::min(plan_.samples, film_.refinement().on() ? Refinement::kFirst : kUnseenWave);
}

/// Whether the first wave is all: each tile's picture is then made while its sums are at hand, in
/// memory that the next tile takes over.
bool Job::at_once() {
  return first_wave() == plan_.samples && !plan_.moving && !film_.refinement().on() &&
         !film_.estimate().on();
}

void Job::trace_waves() {
  pool_ =
      std::make_unique<ThreadPool>(int(std::min(size_t(plan_.thread_count), film_.tiles().size())));
  const bool looks_up =
      plan_.remember && !plan_.is_spread() && !plan_.moving &&
      !film_.wants(GLINT_PASS_FALLBACKS);  // what is not traced has no fallbacks to count
  const std::shared_ptr<FirstHitCache> first_hits =
      looks_up ? scene_->first_hits.of(scene_->camera, plan_, film_) : nullptr;
  const auto held = first_hits ? std::unique_lock(first_hits->mutex, std::try_to_lock)
                               : std::unique_lock<std::mutex>();
  if (held) first_hits->expect(*scene_, plan_);
  FirstHitCache* const usable = held ? first_hits.get() : nullptr;
  make_tracers(usable);
  for (uint32_t first = 0, last = 1; first < plan_.samples && !cancel_; first = last) {
    last = first == 0 ? first_wave()
                      : uint32_t(std::min<uint64_t>(2 * uint64_t(first), plan_.samples));
    double seconds = 0;
    const double before = moving_seconds_;
    {
      const Timer timer(seconds);
      trace_moments(first, last);
      if (!cancel_) refine(last);
    }
    end_wave(last, seconds - (moving_seconds_ - before));
  }
  pool_.reset();
}

void Job::make_tracers(FirstHitCache* first_hits) {
  for (size_t k = 0; k < pool_->size(); ++k)
    tracers_.push_back(std::make_unique<Tracer>(*scene_, plan_, film_, cancel_, first_hits));
}

/// Nothing refers to the scene any more.
void Job::drop_tracers() {
  for (const auto& tracer : tracers_) earlier_rays_ += tracer->counts();
  tracers_.clear();
}

/// The wave: at once, or where things move sample by sample, each of its own scene.
void Job::trace_moments(uint32_t first, uint32_t last) {
  const uint32_t each = plan_.moving ? 1 : last - first;
  for (uint32_t sample = first; sample < last && !cancel_; sample += each) {
    if (plan_.moving && sample > 0 && !wait_for_scene()) return;
    std::atomic<size_t> next{0};
    pool_->run(tracers_.size(),
               [&](size_t thread) { trace_tiles(thread, sample, sample + each, next); });
  }
}

/// False when cancelled.
bool Job::wait_for_scene() {
  double seconds = 0;
  {
    const Timer timer(seconds);
    drop_tracers();
    ask_for_scene();
    if (cancel_ || !scene_->build(plan_.thread_count, BuildQuality(plan_.acceleration), cancel_))
      return false;
    make_tracers(nullptr);
  }
  std::lock_guard lock(mutex_);
  built_ = true;
  moving_seconds_ += seconds;
  return true;
}

void Job::ask_for_scene() {
  std::unique_lock lock(mutex_);
  state_ = GLINT_MOVING;
  changed_.notify_all();
  resumed_.wait(lock, [&] { return cancel_ || moved_; });
  moved_ = false;
  state_ = GLINT_TRACING;
}

/// Looks at what the wave up to `samples` brought, and stops the pixels that are good enough.
void Job::refine(uint32_t samples) {
  if (!film_.refinement().on() || (samples < Refinement::kFirst && !film_.estimate().on())) return;
  on_all_tiles([&](Tracer& tracer, const Tile& tile) { tracer.measure(tile, samples); });
  if (samples < Refinement::kFirst) return;
  if (samples == Refinement::kFirst)
    on_all_tiles([&](Tracer&, const Tile& tile) { film_.measure_neighborhood(tile); });
  on_all_tiles([&](Tracer& tracer, const Tile& tile) { tracer.decide(tile, samples); });
}

/// body(tracer, tile) once for each tile.
template <class Body>
void Job::on_all_tiles(Body body) {
  std::atomic<size_t> next{0};
  const std::vector<Tile>& tiles = film_.tiles();
  on_all_threads([&](Tracer& tracer) {
    for (size_t k; (k = next++) < tiles.size();) body(tracer, tiles[k]);
  });
}

/// body(tracer) once for each tracer.
template <class Body>
void Job::on_all_threads(Body body) {
  pool_->run(tracers_.size(), [&](size_t k) { body(*tracers_[k]); });
}

/// The wave up to `samples` took `seconds`; its picture, unless it was cancelled, belongs to it.
void Job::end_wave(uint32_t samples, double seconds) {
  std::unique_lock lock(mutex_);
  const bool complete = !cancel_;
  if (complete && !at_once()) {
    const Timer timer(seconds);
    film_.renew();
    on_all_tiles([&](Tracer& tracer, const Tile& tile) { tracer.publish(tile, samples); });
  }
  if (complete && samples == plan_.samples)
    film_.forget_sums();  // before anybody who looks at the picture needs room
  trace_seconds_ += seconds;
  rays_ = earlier_rays_;
  for (const auto& tracer : tracers_) rays_ += tracer->counts();
  if (complete) publish(samples, lock);
}

/// Samples [first, last) of the tiles that nobody else has begun.
void Job::trace_tiles(size_t thread, uint32_t first, uint32_t last, std::atomic<size_t>& next) {
  const std::vector<Tile>& tiles = film_.tiles();
  Tracer& tracer = *tracers_[thread];
  const bool publishes = at_once();
  try {
    for (size_t k; !cancel_ && (k = next++) < tiles.size();) {
      const Tile tile = publishes ? film_.on_thread(tiles[k], thread) : tiles[k];
      trace_tile(tracer, tile, first, last);
      if (publishes && !cancel_) tracer.publish(tile, last);
    }
  } catch (...) {
    cancel_ = true;  // the other threads need not go on
    throw;
  }
}

void Job::trace_tile(Tracer& tracer, const Tile& tile, uint32_t first, uint32_t last) {
  tracer.choose(tile);
  for (uint32_t sample = first, count; sample < last && !cancel_; sample += count, done_ += count)
    count = tracer.trace(sample, last);
}

void Job::publish(uint32_t samples, std::unique_lock<std::mutex>& lock) {
  samples_ = samples;
  bool hold = plan_.waves == GLINT_WAVES_HELD && samples < plan_.samples;
  if (hold) state_ = GLINT_HELD;
  changed_.notify_all();
  if (!hold) return;
  resumed_.wait(lock, [&] { return cancel_ || resumed_after_ >= samples; });
  state_ = GLINT_TRACING;
}

double Job::fraction() const {
  return double(done_.load()) / (double(film_.tiles().size()) * plan_.samples);
}

GlintProgress Job::wait(uint32_t milliseconds) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, std::chrono::milliseconds(milliseconds),
                    [&] { return ended() || state_ == GLINT_MOVING || samples_ > reported_; });
  reported_ = samples_;
  return {fraction(), samples_, state_};
}

void Job::resume() {
  std::lock_guard lock(mutex_);
  resumed_after_ = samples_;
  resumed_.notify_all();
}

std::string Job::move(Scene& scene, const GlintRenderSettings& settings) {
  std::lock_guard lock(mutex_);
  if (state_ != GLINT_MOVING) return cancel_ ? "" : "no scene is waited for";
  std::string problems = settings_problems(settings, scene);
  if (!problems.empty()) return problems;
  if (!same_view(scene.camera, scene_->camera)) return "scene: the camera is another one";
  const RenderPlan plan(settings, scene);
  const auto same = [](const Region& a, const Region& b) {
    return a.x0 == b.x0 && a.y0 == b.y0 && a.x1 == b.x1 && a.y1 == b.y1;
  };
  if (!plan.moving || plan.samples != plan_.samples || plan.passes != plan_.passes ||
      !same(plan.region, plan_.region) || !same(plan.shown, plan_.shown))
    return "settings: more than the tables differs from those of the start";
  scene_ = &scene;
  plan_ = plan;
  built_ = false;
  moved_ = true;
  state_ = GLINT_TRACING;
  resumed_.notify_all();
  return {};
}

void Job::cancel() {
  std::lock_guard lock(mutex_);
  cancel_ = true;
  resumed_.notify_all();
}

std::shared_ptr<ZeroedBuffer<float>> Job::picture(int pass, uint64_t size) {
  std::lock_guard lock(mutex_);
  return samples_ > 0 ? film_.picture(pass, size) : nullptr;
}

GlintStats Job::stats() {
  std::lock_guard lock(mutex_);
  GlintStats s{};
  s.trace_seconds = trace_seconds_;
  s.triangles = scene_->instances.triangles;
  s.instances = scene_->instances.placements.size();
  s.primitives = scene_->instances.primitives;
  s.dropped_instances = scene_->instances.dropped;
  s.dropped_lights = scene_->lights.dropped;
  s.features = scene_->features;
  if (plan_.lens_points) s.features |= GLINT_FEATURE_DEPTH_OF_FIELD;
  if (plan_.camera_frames) s.features |= GLINT_FEATURE_CAMERA_MOTION;
  if (plan_.moving) s.features |= GLINT_FEATURE_OBJECT_MOTION;
  if (plan_.open.count) s.features |= GLINT_FEATURE_OPENINGS;
  s.threads = uint32_t(plan_.thread_count);
  s.camera_rays = rays_.camera;
  s.shadow_rays = rays_.shadow;
  s.mirror_rays = rays_.mirror;
  s.refraction_rays = rays_.refraction;
  s.transparent_rays = rays_.transparent;
  s.gather_rays = rays_.gather;
  s.media_points = rays_.media_points;
  if (!built_) return s;
  s.build_seconds = plan_.moving ? moving_seconds_ : scene_->trees.build_seconds();
  AccelStats tree = scene_->trees.accel().stats();
  s.tree_bytes = tree.bytes;
  s.tree_nodes = tree.nodes;
  s.dropped_primitives = tree.dropped;
  return s;
}

}  // namespace glint
