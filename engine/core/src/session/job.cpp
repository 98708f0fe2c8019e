#include "session/job.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <numeric>

#include "integrator/photon_tracer.h"
#include "math/math.h"
#include "system/timer.h"

namespace glint {
namespace {

constexpr uint32_t kUnseenWave =
    16;  // of samples: long enough for packets, short enough to be cancelled

bool same_view(const GlintCamera& a, const GlintCamera& b) {
  const bool same_planes = a.clip_plane_count == b.clip_plane_count &&
                           std::memcmp(a.clip_planes, b.clip_planes, sizeof a.clip_planes) == 0;
  const size_t first = offsetof(GlintCamera, longitude);
  const bool same_rest =
      std::memcmp(reinterpret_cast<const char*>(&a) + first,
                  reinterpret_cast<const char*>(&b) + first, sizeof a - first) == 0;
  return a.width == b.width && a.height == b.height && a.kind == b.kind && same_planes &&
         same_rest && a.clip_start == b.clip_start && a.clip_end == b.clip_end &&
         std::equal(a.window, a.window + 4, b.window) &&
         std::equal(a.world_from_camera, a.world_from_camera + 12, b.world_from_camera);
}

/// The passes of light by the kind of surface, of media and of catchers, that the scene may give
/// any of.
Passes lights_of(const Scene& scene, const RenderPlan& plan) {
  constexpr Passes all = 7, of_media = 3;  // direct, indirect and, of surfaces, their colour
  Passes lights = all << GLINT_PASS_DIFFUSE_DIRECT;
  if (scene.materials.rows_of_lobes.columns > 0 || scene.features & GLINT_FEATURE_MIRROR)
    lights |= all << GLINT_PASS_GLOSSY_DIRECT;
  if (scene.features & GLINT_FEATURE_MIRROR)
    lights |= pass_bit(kMirroredLight) | pass_bit(kMirroredColor);
  if (scene.features & GLINT_FEATURE_REFRACTION)
    lights |= all << GLINT_PASS_TRANSMISSION_DIRECT | pass_bit(kRefractedLight) |
              pass_bit(kRefractedColor);
  lights |= pass_bit(kUnshadowedDiffuse);
  if (scene.materials.rows_of_lobes.columns > 0) lights |= pass_bit(kUnshadowedGloss);
  const bool even = any(scene.world.ambient);
  if (even || scene.materials.has_subsurface) lights |= pass_bit(kOtherDiffuse);
  if (scene.features & GLINT_FEATURE_MIRROR || plan.reflects_gloss) lights |= pass_bit(kOtherGloss);
  if (plan.throws_photons()) lights |= pass_bit(kPhotonLight);
  if (scene.features & GLINT_FEATURE_MEDIA) lights |= of_media << GLINT_PASS_VOLUME_DIRECT;
  if (scene.features & GLINT_FEATURE_SHADOW_CATCHER)
    lights |= pass_bit(GLINT_PASS_SHADOW_CATCHER) | all << kCaughtLight;
  if (!scene.world.transparent_film) lights |= pass_bit(GLINT_PASS_ENVIRONMENT);
  return lights;
}

/// Every so many tiles of a film are looked at for what all have.
constexpr size_t kLookedAt = 7;

uint64_t all_rays(const RayCounts& rays) {
  return rays.camera + rays.shadow + rays.mirror + rays.refraction + rays.transparent +
         rays.gather + rays.probe;
}

/// How far apart in a film of `count` tiles those are that are begun one after the other, some of
/// the golden section: any part of a wave has tiles from everywhere, and so tells what the rest
/// costs.
size_t stride_of(size_t count) {
  size_t stride = std::max<size_t>(1, count * 618 / 1000);
  while (std::gcd(stride, count) > 1) ++stride;
  return stride;
}

}  // namespace

Job::Job(Scene& scene, const GlintRenderSettings& settings)
    : scene_(&scene),
      plan_(settings, scene),
      film_(plan_.region, plan_.traced, plan_.shown, plan_.passes, plan_.error_threshold,
            plan_.light_samples, plan_.crypto_ids, scene.aov_count, scene.light_group_count,
            plan_.reflects_gloss, plan_.resolves ? plan_.interleaving : 1, lights_of(scene, plan_)),
      beyond_(has_beyond() && first_wave() == plan_.samples ? kBeyondAtOnce : 0),
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
  plan_.photon_map = trace_photons(*scene_, plan_, cancel_);
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
  return first_wave() == plan_.samples && !plan_.moving && !film_.resolves() &&
         !film_.refinement().on() && !film_.estimate().on();
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
    double tracing = 0, finishing = 0;
    const double before = moving_seconds_;
    {
      const Timer timer(tracing);
      trace_moments(first, last);
    }
    tracing -= moving_seconds_ - before;
    {
      const Timer timer(finishing);
      if (!cancel_) resolve(last);
      if (!cancel_) refine(last);
    }
    if (!cancel_ && has_beyond() && last < plan_.samples)
      expect_beyond(last, tracing / (last - first), trace_seconds_ + tracing + finishing);
    end_wave(last, tracing + finishing);
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
    plan_.photon_map = trace_photons(*scene_, plan_, cancel_);
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

/// Averages the light of the wave up to `samples` over pixels.
void Job::resolve(uint32_t samples) {
  if (!film_.resolves()) return;
  const uint32_t more = samples == plan_.samples ? plan_.beyond_samples() : 0;
  on_all_tiles([&](Tracer& tracer, const Tile& tile) {
    const ResolveWindow window = film_.window_of(tile, samples);
    const MoreSeen* const seen = more ? tracer.see(tile, film_.uneven(tile, window)) : nullptr;
    film_.resolve(tile, samples, window, seen);
    if (more) ++seen_;
  });
}

bool Job::has_beyond() const { return film_.resolves() && plan_.beyond_samples() > 0; }

/// What the camera rays beyond the samples will take, from the picture after `samples` of them:
/// rays cost what those of the `seconds` so far did, and go to pixels that differ from their
/// neighbours.
void Job::expect_beyond(uint32_t samples, double sample_seconds, double seconds) {
  std::atomic<uint64_t> uneven{0}, pixels{0};
  on_all_tiles([&](Tracer&, const Tile& tile) {
    if (tile.number % kLookedAt != 0) return;
    uneven += film_.uneven(tile, film_.window_of(tile, samples)).size();
    pixels += tile.pixels();
  });
  double all = 0;
  for (const Tile& tile : film_.tiles()) all += double(tile.pixels());
  uint64_t rays = 0;
  for (const auto& tracer : tracers_) rays += all_rays(tracer->counts());
  const double more = all * double(uneven) / double(pixels) * plan_.beyond_samples();
  expected_ = more * seconds / double(rays) / sample_seconds;
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
  const size_t stride = stride_of(tiles.size());
  on_all_threads([&](Tracer& tracer) {
    for (size_t k; (k = next++) < tiles.size();) body(tracer, tiles[k * stride % tiles.size()]);
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
  const size_t stride = stride_of(tiles.size());
  try {
    for (size_t k; !cancel_ && (k = next++) < tiles.size();) {
      const Tile& begun = tiles[k * stride % tiles.size()];
      const Tile tile = publishes ? film_.on_thread(begun, thread) : begun;
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
  for (uint32_t sample = first, count; sample < last && !cancel_; sample += count) {
    count = tracer.trace(sample, last);
    done_ += count;
  }
}

void Job::publish(uint32_t samples, std::unique_lock<std::mutex>& lock) {
  samples_ = samples;
  if (has_beyond() && samples < plan_.samples && std::isfinite(expected_)) beyond_ = expected_;
  bool hold = plan_.waves == GLINT_WAVES_HELD && samples < plan_.samples;
  if (hold) state_ = GLINT_HELD;
  changed_.notify_all();
  if (!hold) return;
  resumed_.wait(lock, [&] { return cancel_ || resumed_after_ >= samples; });
  state_ = GLINT_TRACING;
}

double Job::fraction() const {
  const double done = double(done_.load()) + beyond_ * double(seen_.load());
  return done / (double(film_.tiles().size()) * (double(plan_.samples) + beyond_));
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
  if (plan.reflects_gloss != plan_.reflects_gloss || scene.aov_count != scene_->aov_count ||
      scene.light_group_count != scene_->light_group_count)  // which the film has columns for
    return "scene: its gloss, AOVs or light groups are others";
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
  s.probe_rays = rays_.probe;
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
