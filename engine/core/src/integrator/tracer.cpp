#include "integrator/tracer.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace glint {
namespace {

constexpr size_t kMaxBatch = 8192;  // rays in flight at once
constexpr size_t kFewer = 8;        // times paths at once where each has many cells of media

/// How far samples lie from their pixels' centres.
WindowReach reach_of(const RenderPlan& plan) {
  const double* p = plan.pixel_offsets;
  WindowReach r{p[0], p[1], p[0], p[1]};
  const size_t count = size_t(plan.samples) + plan.beyond_samples();  // each table has the same
  for (const double* const end = p + 2 * count; p != end; p += 2)
    r = {std::min(r.x0, p[0]), std::min(r.y0, p[1]), std::max(r.x1, p[0]), std::max(r.y1, p[1])};
  return r;
}

}  // namespace

Tracer::Tracer(const Scene& scene, const RenderPlan& plan, Film& film,
               const std::atomic<bool>& cancel, FirstHitCache* first_hits)
    : scene_(scene),
      plan_(plan),
      film_(film),
      stages_(best_stages()),
      cancel_(cancel),
      first_hits_(first_hits),
      camera_(scene),
      shader_(scene, plan, stages_),
      direct_({scene, plan, stages_, cancel, scratch_, counts_}),
      queries_(scene, plan, stages_, scratch_),
      subsurface_(scene, plan),
      media_(scene, scratch_),
      ahead_(scene, scratch_),
      batch_(scene, film.passes(), film.keeps_lighting()),
      reach_(reach_of(plan)),
      catches_(scene.features & (GLINT_FEATURE_SHADOW_CATCHER | GLINT_FEATURE_HOLDOUT)),
      glass_differs_(scene.features & GLINT_FEATURE_REFRACTION &&
                     (scene.instances.glass_differs ||
                      std::any_of(scene.lights.begin(), scene.lights.end(),
                                  [](const Light& light) { return light.glass_differs(); }))),
      steps_(steps()),
      program_slots_(size_t(scene.programs.most_slots) * kBlock) {}

Queue Tracer::take(uint32_t visibility, const Queue::Past& past) {
  Queue queue(visibility);
  if (!spare_.empty()) {
    queue = std::move(spare_.back());
    spare_.pop_back();
  }
  queue.visibility = visibility;
  queue.past = past;
  queue.exits = false;
  return queue;
}

void Tracer::give(Queue queue) {
  queue.clear();
  spare_.push_back(std::move(queue));
}

/// The queue is next, cut where it is too long.
void Tracer::wait(Queue queue) {
  if (queue.size() == 0) return give(std::move(queue));
  if (queue.size() <= kMaxBatch) return waiting_.push_back(std::move(queue));
  std::vector<Queue> pieces = split(queue, kMaxBatch);
  for (size_t k = pieces.size(); k-- > 0;) waiting_.push_back(std::move(pieces[k]));
  give(std::move(queue));
}

void Tracer::choose(const Tile& tile) {
  tile_ = &tile;
  slots_.set(tile.width(), tile.height());
  if (film_.refinement().on()) film_.refinement().list_active(tile, active_);
  else if (active_.size() != tile.pixels()) {
    active_.resize(tile.pixels());
    std::iota(active_.begin(), active_.end(), 0u);
  }
  deal();
  surely_empty_ = !active_.empty() && !plan_.is_spread() && !plan_.moving &&
                  camera_.has_frustums() &&
                  !(scene_.features & (GLINT_FEATURE_VISIBLE_LIGHTS | GLINT_FEATURE_MEDIA)) &&
                  !scene_.world.sky_program && scene_.trees.accel().surely_empty(frustum(tile));
}

/// Orders the active slots by class, those of one as they were.
void Tracer::deal() {
  if (plan_.interleaving <= 1) return class_ends_.assign(1, uint32_t(active_.size()));
  std::stable_sort(active_.begin(), active_.end(),
                   [&](uint32_t a, uint32_t b) { return class_of(a) < class_of(b); });
  class_ends_.assign(plan_.interleaving * plan_.interleaving, 0);
  for (const uint32_t slot : active_) ++class_ends_[class_of(slot)];
  std::partial_sum(class_ends_.begin(), class_ends_.end(), class_ends_.begin());
}

/// Round all camera rays of the tile's samples.
TileFrustum Tracer::frustum(const Tile& tile) const {
  const double column = plan_.region.x0 + tile.x0, row = plan_.region.y0 + tile.y0;
  return camera_.frustum(camera_.u(column, reach_.x0), camera_.v(row, reach_.y0),
                         camera_.u(column + tile.width() - 1, reach_.x1),
                         camera_.v(row + tile.height() - 1, reach_.y1));
}

/// How many of a pixel's next samples are traced at once: points of soft lights, and where in lobes
/// rays are reflected, are common to a sample of many pixels.
uint32_t Tracer::packet_samples(uint32_t samples) const {
  if (plan_.interleaving > 1) return 1;
  if (scene_.features &
      (GLINT_FEATURE_WORLD_LIGHT | GLINT_FEATURE_MESH_LIGHT | GLINT_FEATURE_MEDIUM_LIGHT))
    return 1;
  if (plan_.bounces > 0 || plan_.reflects_gloss || direct_.shares() || subsurface_.on()) return 1;
  if (scene_.materials.has_rough_glass || scene_.media.scatters || scene_.media.varies ||
      scene_.programs.asks_rays)
    return 1;
  if (film_.wants(GLINT_PASS_AMBIENT_OCCLUSION)) return 1;
  if ((scene_.features & GLINT_FEATURE_SOFT_LIGHTS) && plan_.light_samples > 1) return 1;
  uint32_t count = WindowPoints::kMaxPacketSamples;
  while (count > samples) count /= 2;
  return count;
}

void Tracer::start_paths() {
  if (catches_) caught_paths_.assign(paths_.size(), {});
  first_.start_at_camera(paths_.size());
  for (size_t c = 0; scene_.features & GLINT_FEATURE_MEDIA && c < 3; ++c)  // dimmed earlier
    std::fill_n(first_.T[c], paths_.size(), 1.0);
  for (size_t k = 0; film_.wants_data() && k < paths_.size(); ++k)
    if (paths_.is_first(k)) first_.want(k, RayTag::kWantsData);
  for (size_t k = 0; film_.wants(GLINT_PASS_AOV) && k < paths_.size(); ++k)
    first_.want(k, RayTag::kWantsAovs);
}

/// One path through a surely_empty tile stands for all.
uint32_t Tracer::trace_empty(uint32_t first, uint32_t last) {
  points_.set(camera_, plan_, *tile_, {offsets_of(active_[0]), first, 1, first});
  follow_some(active_.data(), active_.data() + 1, first, 0);
  paths_.spread(film_, *tile_, active_, last - first);
  return last - first;
}

/// The samples that `points_` is of, of the slots [begin, end), which are of one class.
void Tracer::follow_some(const uint32_t* begin, const uint32_t* end, uint32_t first,
                         uint32_t number) {
  paths_.choose(film_, slots_, begin, end, points_);
  batch_.cost = paths_.sums(film_, GLINT_PASS_COST);
  batch_.fallbacks = paths_.sums(film_, GLINT_PASS_FALLBACKS);
  batch_.thrown = plan_.reflects_gloss ? paths_.thrown() : nullptr;
  batch_.soft_light = film_.refinement().soft_light(*tile_, first) ? paths_.soft_light() : nullptr;
  is_first_ = first == 0;
  follow(plan_.dealt_sample(first, number));
}

uint32_t Tracer::trace(uint32_t first, uint32_t last) {
  if (surely_empty_) return trace_empty(first, last);
  const uint32_t count = packet_samples(last - first);
  const size_t step = Paths::kMost / count / (scene_.media.varies ? kFewer : 1);
  size_t k = 0;
  for (uint32_t number = 0; number < class_ends_.size(); ++number) {
    if (k < class_ends_[number])
      points_.set(camera_, plan_, *tile_, {offsets_of(active_[k]), first, count, first});
    for (const size_t end = class_ends_[number]; k < end && !cancel_;) {
      const size_t some = std::min(step, end - k);
      follow_some(active_.data() + k, active_.data() + k + some, first, number);
      if (plan_.reflects_gloss) paths_.add_gloss(film_, *tile_);
      paths_.add_to(film_, *tile_, stages_);
      keep_meetings();
      k += some;
    }
  }
  return count;
}

void Tracer::measure(const Tile& tile, uint32_t samples) {
  slots_.set(tile.width(), tile.height());
  film_.measure(tile, slots_, samples);
}

void Tracer::decide(const Tile& tile, uint32_t samples) {
  slots_.set(tile.width(), tile.height());
  const bool seen = !(plan_.is_spread() || plan_.moving) || samples >= Refinement::kLensSamples;
  if (!film_.resolves()) return film_.refinement().decide(tile, slots_, samples, seen);
  const bool is_spread = plan_.is_spread() || plan_.moving;
  film_.refinement().decide_ahead(tile, slots_, samples, is_spread ? Refinement::kLensSamples : 1,
                                  film_.estimate());
}

/// What happens to a queue's rays at their next surfaces, in order; those steps that the scene, the
/// film and the plan ask for.
std::vector<Tracer::Step> Tracer::steps() const {
  constexpr uint32_t kPaths = kCameraRays | kMirrorRays | kBlurredRays | kGatherRays,
                     kAll = kPaths | kExitRays;
  using T = Tracer;
  using W = Wave;
  const bool media = scene_.features & GLINT_FEATURE_MEDIA, aovs = film_.wants(GLINT_PASS_AOV);
  std::vector<Step> all = {
      {true, kAll, &on_queue<&T::find_points>},
      {true, kExitRays, &on_queue<&T::show_exits>},
      {true, kPaths, [](T& t, W&) { t.batch_.charge(); }},
      {media, kPaths, &on_queue<&T::dim>},
      {film_.wants(GLINT_PASS_GAP), kCameraRays, &on_queue<&T::find_gaps>},
      {aovs && scene_.materials.bends_normals, kCameraRays,
       [](T& t, W&) { t.keep_mesh_normals(); }},
      {true, kPaths, [](T& t, W& w) { t.shade(w.queue, w.onward(), w.bounced); }},
      {true, kGatherRays, &on_queue<&T::clear_own_light>},
      {batch_.has_groups(), kPaths & ~kGatherRays, &on_queue<&T::note_glow>},
      {true, kBlurredRays | kGatherRays, &on_queue<&T::widen>},
      {film_.wants_data(), kCameraRays, &on_queue<&T::record>},
      {film_.wants_seen(), kCameraRays, &on_queue<&T::note_seen>},
      {film_.resolves(), kCameraRays, &on_queue<&T::note_guides>},
      {aovs, kCameraRays, &on_queue<&T::note_aovs>},
      {film_.keeps_lighting(), kCameraRays, &on_queue<&T::note_colors>},
      {film_.resolves(), kMirrorRays, &on_queue<&T::note_images>},
      {catches_, kPaths, &on_queue<&T::set_aside_caught>},
      {subsurface_.on(), kCameraRays | kMirrorRays, &on_queue<&T::scatter_below>},
      {plan_.bounces > 0, kAll, &on_queue<&T::find_pixels>},
      {true, kAll, &on_queue<&T::illuminate>},
      {catches_, kPaths, &on_queue<&T::settle_caught>},
      {plan_.reflects_gloss, kPaths & ~kGatherRays, [](T& t, W& w) { t.reflect(w.glossy); }},
      {plan_.throws_photons(), kPaths, [](T& t, W& w) { t.add_caustics(w.queue); }},
      {plan_.bounces > 0, kAll, [](T& t, W& w) { t.bounce(w.queue, w.gathering); }},
      {film_.wants(GLINT_PASS_AMBIENT_OCCLUSION), kCameraRays, &on_queue<&T::note_occlusion>},
      {media, kPaths, [](T& t, W& w) { t.scatter(w.queue, w.scattered); }},
      {scene_.materials.has_translucent, kPaths,
       [](T& t, W& w) { t.light_behind(w.queue, &w.behind); }},
      {true, kAll, &on_queue<&T::keep>}};
  std::erase_if(all, [](const Step& step) { return !step.wanted; });
  return all;
}

uint32_t Tracer::kind_of(const Queue& queue) {
  if (queue.exits) return kExitRays;
  if (queue.visibility == kCamera) return kCameraRays;
  if (queue.gathers()) return kGatherRays;
  return queue.past.reflections > 0 ? kBlurredRays : kMirrorRays;
}

/// The paths to the end of their rays.
void Tracer::follow(uint32_t sample) {
  sample_ = sample;
  start_paths();
  ahead_.begin(paths_.size());
  if (!surely_empty_) camera_rays();
  follow_queue(first_);
  while (!waiting_.empty() && !cancel_) {
    Queue queue = std::move(waiting_.back());
    waiting_.pop_back();
    follow_queue(queue);
    give(std::move(queue));
  }
  waiting_.clear();
  if (catches_) show_caught();
}

/// The queue's rays to their next surfaces, and those that go on from there to the waiting ones.
void Tracer::follow_queue(Queue& queue) {
  const Queue::Past &past = queue.past, scattered = past.scattered();
  Queue::Past mirrored = past, of_media = scattered;
  mirrored.gathers = false;
  of_media.in_medium |= past.bounced == 0;
  Wave wave{queue,
            take(queue.visibility, past),
            take(kMirror, mirrored),
            take(kMirror, mirrored.reflected()),
            take(kDiffuse, scattered),
            take(kDiffuse, of_media),
            take(kDiffuse, scattered)};
  batch_.begin(queue);
  batch_.first_hits =
      is_first_ && &queue == &first_ && paths_.is_whole(*tile_) ? first_hits_ : nullptr;
  batch_.first_row = tile_->first_row;
  for (const Step& step : steps_)
    if (step.kinds & kind_of(queue)) step.run(*this, wave);
  for (Queue* more : {&wave.gathering, &wave.scattered, &wave.behind, &wave.straight})
    wait(std::move(*more));
  if (glass_differs_) {
    Queue refracted = take(kTransmission, mirrored);
    wave.bounced.give_refracted(refracted);
    wait(std::move(refracted));
  }
  wait(std::move(wave.bounced));
  wait(std::move(wave.glossy));
}

/// Those of its rays' paths.
void Tracer::find_pixels(const Queue& queue) {
  pixels_.resize(queue.size());
  for (size_t k = 0; k < queue.size(); ++k) pixels_[k] = pixel(queue, k);
}

void Tracer::bounce(const Queue& queue, Queue& gathering) {
  if (direct_.onward.bounces_from_fibres(queue))
    direct_.onward.bounce(batch_, pixels_, sample_, gathering);
}

/// Adds what media on the way of its rays give and scatter.
void Tracer::scatter(const Queue& queue, Queue& scattered) {
  if (queue.past.caught != Queue::Past::kSeen) return;
  direct_.scattered.add_glow({batch_, media_, clear_.data()});
  direct_.scattered.add({batch_, media_, clear_.data()}, pixels_, sample_, scattered);
}

/// Adds what TRANSLUCENT lobes let through of the light on the other side: there they are DIFFUSE
/// ones, of points that a ray meets which comes the other way. gathering: for rays of bounced
/// light; null for none.
void Tracer::light_behind(Queue& queue, Queue* gathering) {
  if (!batch_.turn_round()) return;
  const auto turn = [&] {
    for (double* const d : queue.d)
      for (size_t k = 0; k < queue.size(); ++k) d[k] = -d[k];
  };
  turn();
  batch_.first_hits = nullptr;  // which knows the shadows of this side
  illuminate(queue);
  if (gathering) bounce(queue, *gathering);
  turn();
}

/// The batch's sums to those of the paths, or to those of what rough surfaces reflect.
void Tracer::keep(const Queue& queue) {
  if (queue.past.caught != Queue::Past::kSeen) return keep_caught(queue);
  if (queue.visibility != kCamera && !queue.exits && plan_.clamp_indirect > 0) clamp(queue);
  const bool gloss = queue.is_gloss();
  if (gloss) paths_.swap();
  keep_parts(queue);
  if (gloss) paths_.swap();
}

/// Holds what each ray of the batch adds to the most that is wanted.
void Tracer::clamp(const Queue& queue) {
  const SumColumns& s = batch_.sums;
  for (size_t k = 0; k < queue.size(); ++k) {
    if (queue.depth(k) < 2 && queue.past.reflections == 0) continue;
    const double most = 3 * plan_.clamp_indirect * queue.share[k];
    const Vec3d total = row(s.total, k);
    const double sum = std::fabs(total.x) + std::fabs(total.y) + std::fabs(total.z);
    if (!(sum > most && std::isfinite(sum))) continue;
    for (double* const* columns : {s.total, s.emission, s.environment})
      for (size_t c = 0; columns[0] && c < 3; ++c) columns[c][k] *= most / sum;
    for (size_t group = 0; group < batch_.group_count(); ++group)
      for (size_t c = 0; batch_.gives(group) && c < 3; ++c) batch_.group(group)[c][k] *= most / sum;
  }
}

void Tracer::keep_parts(const Queue& queue) {
  auto keep_part = [&](int part, double* const(&columns)[3]) {
    double* sums = paths_.sums(film_, part);
    if (!sums || !columns[0]) return;
    for (size_t c = 0; &queue == &first_ && c < 3; ++c, sums += paths_.stride())
      stages_.add(sums, columns[c], queue.size());
    for (size_t c = 0; &queue != &first_ && c < 3; ++c)
      for (size_t k = 0; k < queue.size(); ++k)
        sums[c * paths_.stride() + queue.slot(k)] += columns[c][k];
  };
  const SumColumns& s = batch_.sums;
  keep_part(GLINT_PASS_COMBINED, s.total);
  if (batch_.has_groups()) keep_groups(queue);
  if (film_.keeps_lighting()) keep_lighting(queue);
  if (queue.gathers()) return keep_gathered(queue);
  if (queue.visibility != kCamera) return keep_part(GLINT_PASS_MIRROR, s.total);
#define SUM_COLUMN(name, pass, needed, beyond) \
  if (pass != GLINT_PASS_COMBINED) keep_part(pass, s.name);
#include "shading/path_state.inc"
}

void Tracer::publish(const Tile& tile, uint32_t samples) {
  slots_.set(tile.width(), tile.height());
  film_.publish(tile, slots_, samples, stages_);
}

}  // namespace glint
