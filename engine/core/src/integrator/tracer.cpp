#include "integrator/tracer.h"

#include <algorithm>
#include <numeric>

#include "math/math.h"
#include "session/timer.h"

namespace glint {
namespace {

constexpr size_t kMaxBatch = 8192;  // rays in flight at once
constexpr size_t kFewer = 8;        // times paths at once where each has many cells of media

/// How far samples lie from their pixels' centres.
WindowReach reach_of(const RenderPlan& plan) {
  const double* p = plan.pixel_offsets;
  WindowReach r{p[0], p[1], p[0], p[1]};
  for (const double* const end = p + 2 * size_t(plan.samples); p != end; p += 2)
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
      direct_(scene, plan, stages_, cancel, scratch_),
      queries_(scene, plan, stages_, scratch_),
      media_(scene, scratch_),
      ahead_(scene, scratch_),
      batch_(scene, film.passes()),
      reach_(reach_of(plan)),
      catches_(scene.features & GLINT_FEATURE_SHADOW_CATCHER),
      program_slots_(size_t(scene.most_slots) * kBlock) {}

Queue Tracer::take(uint32_t visibility, uint32_t reflections, bool glossy, bool gathers) {
  Queue queue(visibility);
  if (!spare_.empty()) {
    queue = std::move(spare_.back());
    spare_.pop_back();
  }
  queue.visibility = visibility;
  queue.reflections = reflections;
  queue.glossy = glossy;
  queue.gathers = gathers;
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
  surely_empty_ = !active_.empty() && !plan_.is_spread() && !plan_.moving &&
                  !camera_.is_panorama() &&
                  !(scene_.features & (GLINT_FEATURE_VISIBLE_LIGHTS | GLINT_FEATURE_MEDIA)) &&
                  !scene_.sky_program && scene_.accel().surely_empty(frustum(tile));
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
  if (scene_.features &
      (GLINT_FEATURE_WORLD_LIGHT | GLINT_FEATURE_MESH_LIGHT | GLINT_FEATURE_BOUNCED_LIGHT))
    return 1;
  if (direct_.reflects() || direct_.shares()) return 1;
  if (scene_.has_rough_glass || scene_.scatters || scene_.varies || scene_.asks_rays) return 1;
  if (film_.wants(GLINT_PASS_AMBIENT_OCCLUSION)) return 1;
  if ((scene_.features & GLINT_FEATURE_SOFT_LIGHTS) && plan_.light_samples > 1) return 1;
  uint32_t count = WindowPoints::kMaxPacketSamples;
  while (count > samples) count /= 2;
  return count;
}

/// The queue's camera rays hit nothing, and nobody asks where they lead.
void Tracer::miss(const Queue& queue) {
  std::fill_n(batch_.instance.data(), queue.size(), Hit::kNone);
  std::fill_n(batch_.material.data(), queue.size(), missed(queue));
}

void Tracer::start_paths() {
  first_.start_at_camera(paths_.size());
  for (size_t c = 0; scene_.features & GLINT_FEATURE_MEDIA && c < 3; ++c)  // dimmed earlier
    std::fill_n(first_.column(Queue::kT + c), paths_.size(), 1.0);
  for (size_t k = 0; film_.wants_data() && k < paths_.size(); ++k)
    if (paths_.is_first(k)) first_.want_data(k);
  for (size_t k = 0; film_.wants(GLINT_PASS_AOV) && k < paths_.size(); ++k) first_.want_aovs(k);
}

void Tracer::camera_rays() {
  CameraStage stage = camera_.stage();
  stage.count = paths_.size();
  stage.across = paths_.u();
  stage.upward = paths_.v();
  stage.lens_x = paths_.lens(0);
  stage.lens_y = paths_.lens(1);
  stage.bend = stage.lens_x ? 1 / plan_.lens_focus : 0;
  for (size_t c = 0; c < 12; ++c) stage.frame[c] = paths_.frame(c);
  for (size_t k = 0; k < 3; ++k) {
    stage.o[k] = first_.column(Queue::kO + k);
    stage.d[k] = first_.column(Queue::kD + k);
  }
  stage.t_min = first_.column(Queue::kTMin);
  stage.t_max = first_.column(Queue::kTMax);
  stages_.camera(stage);
  camera_.clip(stage);
  const Vec3d eye = plan_.camera_frames ? Vec3d{} : camera_.eye();  // frames have their own
  const bool beside = !camera_.has_one_eye() || plan_.is_spread();
  for (size_t k = 0; any(eye) && k < 3; ++k)
    for (size_t i = 0; i < stage.count; ++i)
      stage.o[k][i] = (beside ? stage.o[k][i] : 0) + eye[int(k)];
  for (size_t k = 0; (beside || any(eye)) && k < 3; ++k)
    std::copy_n(stage.o[k], stage.count, first_.column(Queue::kStart + k));
  if (stage.panorama) leave_out_unseen(stage);
}

/// Beyond the picture of a panorama's lens rays bring nothing: it is black there.
void Tracer::leave_out_unseen(const CameraStage& stage) {
  for (size_t k = 0; k < stage.count; ++k) {
    const bool seen = stage.t_max[k] >= 0;
    for (size_t c = 0; c < 3; ++c) first_.column(Queue::kT + c)[k] = seen ? 1 : 0;
  }
}

/// One path through a surely_empty tile stands for all.
uint32_t Tracer::trace_empty(uint32_t first, uint32_t last) {
  points_.set(camera_, plan_, *tile_, first, 1);
  follow_some(active_.data(), active_.data() + 1, first);
  paths_.spread(film_, *tile_, active_, last - first);
  return last - first;
}

/// The samples that `points_` is of, of the slots [begin, end).
void Tracer::follow_some(const uint32_t* begin, const uint32_t* end, uint32_t first) {
  paths_.choose(film_, slots_, begin, end, points_);
  batch_.cost = paths_.sums(film_, GLINT_PASS_COST);
  batch_.fallbacks = paths_.sums(film_, GLINT_PASS_FALLBACKS);
  batch_.softly_lit = film_.refinement().softly_lit(*tile_, first) ? paths_.softly_lit() : nullptr;
  follow(first);
}

uint32_t Tracer::trace(uint32_t first, uint32_t last) {
  if (surely_empty_) return trace_empty(first, last);
  const uint32_t count = packet_samples(last - first);
  const size_t step = Paths::kMost / count / (scene_.varies ? kFewer : 1);
  if (!active_.empty()) points_.set(camera_, plan_, *tile_, first, count);
  for (size_t k = 0; k < active_.size() && !cancel_; k += step) {
    const uint32_t* const begin = active_.data() + k;
    follow_some(begin, begin + std::min(step, active_.size() - k), first);
    paths_.add_to(film_, *tile_, stages_);
    keep_meetings();
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
  film_.refinement().decide(tile, slots_, samples, seen);
}

/// The paths to the end of their rays.
void Tracer::follow(uint32_t sample) {
  start_paths();
  ahead_.begin(paths_.size());
  if (!surely_empty_) camera_rays();
  follow_queue(first_, sample);
  while (!waiting_.empty() && !cancel_) {
    Queue queue = std::move(waiting_.back());
    waiting_.pop_back();
    follow_queue(queue, sample);
    give(std::move(queue));
  }
  waiting_.clear();
}

/// The queue's rays to their next surfaces, and those that go on from there to the waiting ones.
void Tracer::follow_queue(Queue& queue, uint32_t sample) {
  const bool apart = queue.visibility == kCamera || queue.glossy;  // else straight on is a mirror's
  NextRays next{take(queue.visibility, queue.reflections, queue.glossy, queue.gathers),
                take(kMirror, queue.reflections), take(kMirror, queue.reflections + 1, true),
                take(kMirror, queue.reflections + 1, true, true)};
  process(queue, sample, apart ? next.straight : next.bounced, next);
  wait(std::move(next.gathering));
  wait(std::move(next.straight));
  wait(std::move(next.bounced));
  wait(std::move(next.glossy));
}

void Tracer::process(Queue& queue, uint32_t sample, Queue& straight, NextRays& next) {
  sample_ = sample;
  batch_.begin(queue);
  batch_.first_hits =
      sample == 0 && &queue == &first_ && paths_.is_whole(*tile_) ? first_hits_ : nullptr;
  batch_.first_row = tile_->first_row;
  surely_empty_ ? miss(queue) : find_points(queue);
  for (size_t k = 0; batch_.cost && k < queue.size(); ++k) batch_.charge(k);
  if (scene_.features & GLINT_FEATURE_MEDIA) dim(queue);
  if (sample == 0 && &queue == &first_ && film_.wants(GLINT_PASS_GAP)) find_gaps();
  const bool gives_aovs = queue.visibility == kCamera && film_.wants(GLINT_PASS_AOV);
  for (size_t c = 0; gives_aovs && scene_.bends_normals && c < 3; ++c)
    mesh_normals_[c].assign(batch_.points.n[c], batch_.points.n[c] + queue.size());
  shade(queue, straight, next.bounced);
  if (queue.gathers) matten(queue);
  else if (batch_.has_groups()) note_glow(queue);
  if (queue.reflections > 0) widen(queue);
  if (sample == 0 && queue.visibility == kCamera && film_.wants_data()) record(queue);
  if (queue.visibility == kCamera && film_.wants_seen()) note_seen(queue);
  if (gives_aovs) note_aovs(queue);
  if (queue.visibility == kCamera && film_.wants_lighting()) note_colors(queue);
  if (catches_) set_aside_caught(queue);
  direct_.illuminate(batch_, sample, counts_);
  if (catches_ && !caught_.empty()) settle_caught(queue, sample);
  if (!queue.gathers) direct_.reflect(batch_, sample, next.glossy, counts_);
  direct_.gather(batch_, sample, next.gathering, counts_);
  if (queue.visibility == kCamera && film_.wants(GLINT_PASS_AMBIENT_OCCLUSION))
    note_occlusion(queue, sample);
  if (scene_.features & GLINT_FEATURE_MEDIA && !queue.gathers)
    direct_.scatter(batch_, media_, clear_.data(), sample, counts_);
  keep(queue);
}

void Tracer::find_hits(const Queue& queue) {
  if (batch_.first_hits && batch_.first_hits->look_up(*tile_, batch_.hits())) return;
  {
    const Timer timer(counts_.tracing);
    Rays rays = queue.rays();
    // Every surface counts for what is remembered, and for passes that tell of holes as of other
    // surfaces.
    const bool all = batch_.first_hits || film_.wants(GLINT_PASS_COST) ||
                     film_.wants(GLINT_PASS_GAP) || film_.wants(GLINT_PASS_AOV);
    rays.opacity = all ? nullptr : scene_.opacity();
    const bool straight = rays.opacity && queue.visibility == kCamera && &queue != &first_;
    if (straight && !batch_.fallbacks) ahead_.closest(queue, batch_.hits());
    else scene_.accel().closest(rays, batch_.hits(), scratch_);
  }
  batch_.charge_fallbacks();
  if (&queue == &first_) counts_.camera += queue.size();
  if (batch_.first_hits) batch_.first_hits->keep(*tile_, batch_.hits());
}

void Tracer::find_points(const Queue& queue) {
  find_hits(queue);
  SurfaceStage stage{};
  stage.count = queue.size();
  stage.points = batch_.points;
  for (size_t c = 0; c < 3; ++c) {
    stage.start[c] = queue.column(Queue::kStart + c);
    stage.d[c] = queue.column(Queue::kD + c);
  }
  stage.instance = batch_.instance.data();
  stage.primitive = batch_.primitive.data();
  stage.u = batch_.u.data();
  stage.v = batch_.v.data();
  stage.instances = scene_.instance_shapes.data();
  stage.groups = scene_.group_shapes.data();
  stage.missed = missed(queue);
  stages_.surface(stage);
  for (size_t k = 0; !scene_.only_meshes && k < queue.size(); ++k) {
    if (batch_.material[k] != kNoMaterial) continue;
    const Path path = queue.path(k);
    batch_.set_surface(k, surface_at(scene_, path.start, queue.ray(k).d, batch_.hit(k)));
    const GlintInstances& group = scene_.group(batch_.instance[k]);
    batch_.material[k] = group.flags & GLINT_HOLDOUT
                             ? scene_.holdout()
                             : scene_.material_of(group, batch_.primitive[k]);
  }
}

/// Highlights that rough surfaces show of others are no narrower than their own lobes: points of
/// lights would be dots in them.
void Tracer::widen(const Queue& queue) {
  for (size_t k = 0; k < queue.size(); ++k) {
    const double widest = queue.widest(k);
    for (int number = 0; number < scene_.max_specular; ++number) {
      double* const column =
          batch_.specular + size_t(scene_.specular_columns * number) * batch_.stride + k;
      double& exponent = column[SpecularTerm::kExponent * batch_.stride];
      if (!(exponent > widest)) continue;
      for (size_t c = 0; c < 3; ++c) column[c * batch_.stride] *= (widest + 1) / (exponent + 1);
      exponent = widest;
    }
  }
}

/// What media before their hits leave of the rays' weights.
void Tracer::dim(Queue& queue) {
  const Rays rays = queue.rays();
  media_.find(rays, counts_);
  clear_.resize(queue.size());
  ends_.resize(queue.size());
  const double far = queue.gathers ? 0 : kInfinity;  // where nothing is met
  for (size_t k = 0; k < queue.size(); ++k) ends_[k] = batch_.missed(k) ? far : batch_.t[k];
  media_.march(rays, ends_.data(), sample_,
               queue.visibility == kCamera ? RayKind::kCamera : RayKind::kBounced, counts_);
  for (size_t k = 0; k < queue.size(); ++k) {
    clear_[k] = queue.path(k).T;
    const Vec3d T = media_.passed(k, rays.t_min[k], ends_[k]) * clear_[k];
    for (int c = 0; c < 3; ++c) queue.column(Queue::kT + size_t(c))[k] = T[c];
  }
}

void Tracer::shade(const Queue& queue, Queue& straight, Queue& bounced) {
  ShadeStage stage{};
  stage.count = queue.size();
  stage.material = batch_.material.data();
  stage.terms = (queue.reflections > 0 ? scene_.reflected_terms : scene_.material_terms).data();
  stage.specular_terms = scene_.specular_terms.data();
  stage.max_specular = scene_.max_specular;
  stage.sums = batch_.sums;
  stage.specular_columns = scene_.specular_columns;
  stage.view_terms = scene_.view_terms.data();
  stage.max_view = scene_.max_view;
  for (size_t c = 0; c < 3; ++c) {
    stage.n[c] = batch_.points.n[c];
    stage.d[c] = queue.column(Queue::kD + c);
  }
  for (size_t c = 0; c < 3; ++c) {
    stage.T[c] = queue.column(Queue::kT + c);
    stage.diffuse[c] = batch_.diffuse[c];
  }
  stage.specular = batch_.specular;
  stage.stride = batch_.stride;
  stage.lit = batch_.lit.data();
  stage.others = batch_.others.data();
  const size_t others = stages_.shade(stage);
  const bool sees_lights = scene_.features & GLINT_FEATURE_VISIBLE_LIGHTS && queue.reflections == 0;
  for (size_t c = 0; batch_.has_groups() && c < 3; ++c)
    std::copy_n(batch_.sums.emission[c], queue.size(), batch_.glow[c]);
  for (size_t k = 0; sees_lights && k < queue.size(); ++k) see_lights(k);
  double* lost = paths_.lost_alpha();
  for (size_t k = 0; scene_.transparent_film && queue.visibility == kCamera && k < queue.size();
       ++k)
    if (batch_.missed(k)) lost[queue.slot(k)] += mean(queue.path(k).T);
  for (size_t i = 0; i < others;) {
    const uint32_t k = batch_.others[i];
    if (batch_.material[k] == scene_.holdout()) {
      shader_.hold_out(batch_, k, film_, pixel(queue, k), lost[queue.slot(k)]);
      ++i;
    } else if (batch_.material[k] == scene_.surroundings()) i += see_sky(queue, i, others - i);
    else i += vary(queue, i, others - i, {straight, bounced});
  }
}

/// Adds the lights' own shapes that ray k sees.
void Tracer::see_lights(size_t k) {
  if (scene_.features & GLINT_FEATURE_VISIBLE_LIGHTS)
    shader_.seen_lights(batch_, k, scene_.features & GLINT_FEATURE_MEDIA ? &media_ : nullptr,
                        clear_.data());
}

/// Shades those of the batch's `others` from `first` on, of `count`, that share its material. How
/// many they are.
size_t Tracer::vary(const Queue& queue, size_t first, size_t count, const Leaving& next) {
  const uint32_t* rows = batch_.others.data() + first;
  const Material& material = scene_.materials[batch_.material[rows[0]]];
  EvaluateStage stage{};
  stage.tables = scene_.input_tables();
  while (stage.count < count && batch_.material[rows[stage.count]] == batch_.material[rows[0]])
    ++stage.count;
  stage.rows = rows;
  stage.instance = batch_.instance.data();
  stage.primitive = batch_.primitive.data();
  stage.lobes = scene_.lobe_shapes.data() + material.first_lobe;
  stage.lobe_count = material.lobe_count;
  stage.dark = queue.reflections > 0 && scene_.features & GLINT_FEATURE_MESH_LIGHT;
  stage.sums = batch_.sums;
  for (size_t c = 0; c < 3; ++c) {
    if (batch_.has_groups()) stage.sums.emission[c] = batch_.glow[c];
    stage.T[c] = queue.column(Queue::kT + c);
    stage.diffuse[c] = batch_.diffuse[c];
    stage.ambient[c] = scene_.ambient[int(c)];
    stage.n[c] = batch_.points.n[c];
    stage.d[c] = queue.column(Queue::kD + c);
    if (c < 2) stage.weights[c] = batch_.points.weights[c];
    stage.x[c] = batch_.points.x[c];
    stage.g[c] = batch_.points.g[c];
    stage.bent[c] = batch_.points.n[c];
    stage.unbent[c] = batch_.unbent[c];
    stage.start[c] = queue.column(Queue::kStart + c);
  }
  if (material.program > 0) {
    stage.program = &scene_.program_of(material);
    stage.normal = material.normal;
    stage.bump_shadowing = material.bump_shadowing;
    stage.base_normal = material.base_normal;
    stage.bump = batch_.bump;
    stage.kind = queue.visibility == kCamera ? RayKind::kCamera : RayKind::kBounced;
    stage.slots = program_slots_.data();
    stage.outside = batch_.points.outside;
    stage.tags = queue.tags();
    stage.offset = batch_.points.offset;
    if (stage.program->asks_rays) stage.queries = queries_.at(batch_, sample_, counts_);
  }
  stage.specular_columns = scene_.specular_columns;
  stage.specular = batch_.specular;
  stage.passing = batch_.passing_columns;
  stage.passing_columns = batch_.passing_width;
  stage.stride = batch_.stride;
  stage.lit = batch_.lit.data();
  stage.passing_rows = batch_.passing_rows.data();
  pass_on(queue, stages_.vary(stage), next);
  for (size_t i = 0; batch_.has_groups() && i < stage.count; ++i)
    Batch::add_to(batch_.sums.emission, rows[i], row(batch_.glow, rows[i]));
  for (size_t i = 0; film_.wants_data() && material.passing > 0 && i < stage.count; ++i)
    if (queue.wants_data(rows[i]))
      shader_.record_veil(batch_, rows[i], film_, pixel(queue, rows[i]));
  return stage.count;
}

/// Adds what the world's program gives to those of the batch's `others` from `first` on, of
/// `count`, that hit nothing. How many they are.
size_t Tracer::see_sky(const Queue& queue, size_t first, size_t count) {
  const uint32_t* rows = batch_.others.data() + first;
  size_t seen = 0;
  while (seen < count && batch_.material[rows[seen]] == scene_.surroundings()) {
    const uint32_t* some = rows + seen;
    const size_t most = std::min(count - seen, kBlock);
    size_t here = 1;
    while (here < most && batch_.material[some[here]] == scene_.surroundings()) ++here;
    const double* const slot = run_sky(queue, some, here);
    for (size_t i = 0; i < here; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const double radiance = slot[c * kBlock + i], T = queue.column(Queue::kT + c)[some[i]];
        const double light = std::isfinite(radiance) ? T * radiance : 0;
        batch_.sums.total[c][some[i]] += light;
        if (batch_.sums.environment[c]) batch_.sums.environment[c][some[i]] += light;
      }
    seen += here;
  }
  return seen;
}

/// What the world's program gives to up to a block of rays: its three slots.
const double* Tracer::run_sky(const Queue& queue, const uint32_t* rows, size_t count) {
  const RayKind kind = queue.visibility == kCamera ? RayKind::kCamera : RayKind::kBounced;
  ProgramPoints points{};
  for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
    const uint32_t k = rows[std::min(i, count - 1)];
    points.outside[i] = -1;
    for (size_t c = 0; c < 3; ++c) points.d[c][i] = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t axis = 0; axis < 3; ++axis)
        points.d[axis][i] += scene_.sky_axes[axis][int(c)] * queue.column(Queue::kD + c)[k];
  }
  stages_.program({scene_.input_tables(), scene_.sky_program, &points, kind, count,
                   program_slots_.data(), nullptr});
  return program_slots_.data() + scene_.sky_slot;
}

/// Sends on the rays of the first `count` of the batch's `passing_rows`, which share a material.
void Tracer::pass_on(const Queue& queue, size_t count, const Leaving& next) {
  uint32_t* const all = batch_.passing_rows.data();
  size_t shown = count;  // those beyond are on catchers
  if (catches_)
    shown = size_t(
        std::stable_partition(all, all + count, [&](uint32_t k) { return !is_caught(queue, k); }) -
        all);
  for (size_t first = 0, some; first < count; first += some) {
    const size_t end = first < shown ? shown : count;
    some = cuts_.leading(queue, all + first, end - first);
    shader_.pass_on(batch_, sample_, all + first, some, next, counts_,
                    first >= shown || queue.gathers);
  }
}

/// How far behind the first hits of the camera rays the next ones lie.
void Tracer::find_gaps() {
  std::vector<Ray> rays;
  std::vector<uint32_t> from;
  for (uint32_t k = 0; k < first_.size(); ++k) {
    if (batch_.missed(k) || !paths_.is_first(k)) continue;
    rays.push_back(first_.ray(k));
    from.push_back(k);
    rays.back().t_min = beyond(batch_.t[k]);
  }
  std::vector<Hit> hits(rays.size());
  scene_.accel().closest(rays.data(), hits.data(), rays.size(), scratch_);
  for (size_t i = 0; i < hits.size(); ++i) {
    if (hits[i].instance != Hit::kNone)
      film_.set_gap(pixel(first_, from[i]), (hits[i].t - batch_.t[from[i]]) / scene_.anchor.scale);
  }
}

/// Data passes of the hits on materials that let nothing through.
void Tracer::record(const Queue& queue) {
  const bool depth_alone = film_.wants_depth_alone();
  for (size_t k = 0; k < queue.size(); ++k) {
    const uint32_t material = batch_.material[k];
    if (!queue.wants_data(k) || material >= scene_.materials.size() ||
        scene_.materials[material].passing > 0)
      continue;
    if (depth_alone) film_.set_depth(pixel(queue, k), camera_.depth(row(batch_.points.x, k)));
    else shader_.record(batch_, k, film_, pixel(queue, k));
  }
}

/// What the passes that are means of what is seen have of the hits of camera rays: a share of each
/// path stays at each surface.
void Tracer::note_seen(const Queue& queue) {
  double* const clear = paths_.sums(film_, GLINT_PASS_MIST);
  for (size_t k = 0; k < queue.size(); ++k) {
    if (batch_.material[k] >= scene_.materials.size()) continue;  // a holdout, or nothing
    const Vec3d T = queue.path(k).T, passed = shader_.passed(batch_, k);
    if (clear) {
      const Vec3d stays{1 - std::clamp(passed.x, 0.0, 1.0), 1 - std::clamp(passed.y, 0.0, 1.0),
                        1 - std::clamp(passed.z, 0.0, 1.0)};
      const double distance = camera_.distance(row(batch_.points.x, k));
      clear[queue.slot(k)] += (1 - scene_.mist.at(distance)) * mean(T * stays);
    }
    const double weight = mean(T) * (1 - mean(passed));
    if (film_.wants_denoising()) note_denoising(k, queue.slot(k), weight);
    if (!film_.wants_cryptomatte() || !(weight > 0)) continue;
    const GlintInstances& group = scene_.group(batch_.instance[k]);
    meetings_.push_back(
        {queue.slot(k),
         {group.crypto_object, scene_.materials[batch_.material[k]].crypto, group.crypto_asset},
         weight});
  }
}

/// What denoisers are told of a surface at which that share of the path's sample stays.
void Tracer::note_denoising(size_t k, uint32_t path, double share) {
  const auto add = [&](int pass, Vec3d value) {
    double* const sum = paths_.sums(film_, pass);
    for (size_t c = 0; sum && c < film_.channels_of(pass); ++c)
      sum[c * paths_.stride() + path] += value[int(c)];
  };
  const double far = camera_.distance_seen(row(batch_.points.x, k));
  add(GLINT_PASS_DENOISING_NORMAL, share * camera_.along_axes(row(batch_.points.n, k)));
  add(GLINT_PASS_DENOISING_ALBEDO, albedo(k));
  add(GLINT_PASS_DENOISING_DEPTH, share * Vec3d{far, far, far});
}

/// T times about what of even light a point's surface gives back, mirrors and glass without what
/// Fresnel says.
Vec3d Tracer::albedo(size_t k) const {
  Vec3d sum;
  const Material& material = scene_.materials[batch_.material[k]];
  const Lobe* lobe = scene_.lobes.data() + material.first_lobe;
  for (int i = 0; i < material.passing; ++lobe) {
    if (lobe->kind == GLINT_MIRROR || lobe->kind == GLINT_REFRACTION) sum += batch_.passing(k, i);
    i += (1u << lobe->kind & kPassing) != 0;
  }
  sum = batch_.queue->path(k).T * sum;
  if (!batch_.lit[k]) return sum;
  const Highlights given = highlights(k);
  return sum + row(batch_.diffuse, k) + given.glossy + given.matt;
}

/// T times about what of even light the highlights of a lit point give back.
Tracer::Highlights Tracer::highlights(size_t k) const {
  Highlights sum;
  for (int term = 0; term < scene_.max_specular; ++term) {
    const double* const column =
        batch_.specular + size_t(scene_.specular_columns * term) * batch_.stride + k;
    const double exponent = column[SpecularTerm::kExponent * batch_.stride];
    const Vec3d k_s{column[0], column[batch_.stride], column[2 * batch_.stride]};
    if (exponent == SpecularTerm::kSheen || exponent == SpecularTerm::kFibreDiffuse)
      sum.matt += k_s;
    else if (exponent < 0) sum.glossy += k_s;
    else sum.glossy += 8 / (exponent + 2) * k_s;
  }
  return sum;
}

/// What the surfaces that camera rays meet give to AOVs, up to the first that lets less than half
/// through: material by material.
void Tracer::note_aovs(const Queue& queue) {
  aov_rows_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (queue.wants_aovs(k) && batch_.material[k] < scene_.materials.size() &&
        scene_.materials[batch_.material[k]].aov > 0)
      aov_rows_.push_back(k);
  std::stable_sort(aov_rows_.begin(), aov_rows_.end(),
                   [&](uint32_t a, uint32_t b) { return batch_.material[a] < batch_.material[b]; });
  for (size_t first = 0; first < aov_rows_.size();)
    first += note_aovs_of(queue, aov_rows_.data() + first, aov_rows_.size() - first);
}

/// Those of the rows that share the first one's material, up to a block. How many they are.
size_t Tracer::note_aovs_of(const Queue& queue, const uint32_t* rows, size_t count) {
  const uint32_t number = batch_.material[rows[0]];
  const Material& given = scene_.materials[size_t(scene_.materials[number].aov - 1)];
  size_t here = 1;
  while (here < std::min(count, kBlock) && batch_.material[rows[here]] == number) ++here;
  Surface surfaces[kBlock];
  for (size_t i = 0; i < here; ++i) {
    surfaces[i] = batch_.surface(rows[i]);
    if (scene_.materials[number].normal > 0)  // the batch's is bent by now
      surfaces[i].n = {mesh_normals_[0][rows[i]], mesh_normals_[1][rows[i]],
                       mesh_normals_[2][rows[i]]};
  }
  if (given.program > 0) run_aovs(queue, given, rows, surfaces, here);
  double* const sums = paths_.sums(film_, GLINT_PASS_AOV);
  bool gives[256] = {};
  for (uint32_t l = 0; l < given.lobe_count; ++l) {
    const Lobe& lobe = scene_.lobes[given.first_lobe + l];
    const size_t aov = size_t(lobe.exponent);
    for (size_t i = 0; i < here; ++i) {
      PointReads reads;
      reads.slots = program_slots_.data() + i;
      const Vec3d color = coefficient(scene_, lobe, surfaces[i], reads);
      const double weight = mean(queue.path(rows[i]).T);
      double* const sum = sums + 4 * aov * paths_.stride() + queue.slot(rows[i]);
      for (size_t c = 0; c < 3; ++c) sum[c * paths_.stride()] += weight * color[int(c)];
      if (!gives[aov]) sum[3 * paths_.stride()] += weight;
    }
    gives[aov] = true;
  }
  return here;
}

/// The program of a material's AOVs at up to a block of points.
void Tracer::run_aovs(const Queue& queue, const Material& given, const uint32_t* rows,
                      const Surface* surfaces, size_t count) {
  ProgramPoints points{};
  for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
    const Surface& s = surfaces[std::min(i, count - 1)];
    const Vec3d d = queue.ray(rows[std::min(i, count - 1)]).d;
    points.instance[i] = s.instance;
    points.primitive[i] = s.primitive;
    points.outside[i] = s.outside ? -1 : 0;
    for (int c = 0; c < 3; ++c) {
      points.weights[c][i] = s.weights[c];
      points.x[c][i] = s.x[c];
      points.g[c][i] = s.g[c];
      points.n[c][i] = s.n[c];
      points.d[c][i] = d[c];
    }
    const uint32_t row = rows[std::min(i, count - 1)];
    points.length[i] = length(s.x - queue.path(row).start) / scene_.anchor.scale;
    points.tags[i] = queue.tags()[row];
    points.offset[i] = s.offset;
    points.row[i] = row;
  }
  const ProgramShape& program = scene_.program_of(given);
  stages_.program({scene_.input_tables(), &program, &points, RayKind::kCamera, count,
                   program_slots_.data(),
                   program.asks_rays ? queries_.at(batch_, sample_, counts_) : nullptr});
}

/// The film learns what the paths met, in the order of each pixel's samples.
void Tracer::keep_meetings() {
  const auto earlier = [](const CryptoMeeting& a, const CryptoMeeting& b) {
    return a.path < b.path;
  };
  std::stable_sort(meetings_.begin(), meetings_.end(), earlier);
  for (CryptoMeeting& m : meetings_) m.path = paths_.slot(m.path);
  film_.cryptomatte().add(tile_->number, meetings_);
  meetings_.clear();
}

/// The batch's sums to those of the paths.
void Tracer::keep(const Queue& queue) {
  auto keep_part = [&](int part, double* const(&columns)[3]) {
    double* sums = paths_.sums(film_, part);
    for (size_t c = 0; sums && columns[0] && c < 3; ++c, sums += paths_.stride()) {
      if (&queue == &first_) stages_.add(sums, columns[c], queue.size());
      else
        for (size_t k = 0; k < queue.size(); ++k) sums[queue.slot(k)] += columns[c][k];
    }
  };
  const SumColumns& s = batch_.sums;
  keep_part(GLINT_PASS_COMBINED, s.total);
  if (batch_.has_groups()) keep_groups(queue);
  if (film_.wants_lighting()) keep_lighting(queue);
  if (queue.gathers) return keep_gathered(queue);
  if (queue.visibility != kCamera) return keep_part(GLINT_PASS_MIRROR, s.total);
  keep_part(GLINT_PASS_AMBIENT, s.ambient);
  keep_part(GLINT_PASS_EMISSION, s.emission);
  keep_part(GLINT_PASS_ENVIRONMENT, s.environment);
  keep_part(GLINT_PASS_DIFFUSE, s.diffuse);
  keep_part(GLINT_PASS_SPECULAR, s.specular);
  keep_part(GLINT_PASS_SHADOW, s.shadow);
}

void Tracer::publish(const Tile& tile, uint32_t samples) {
  slots_.set(tile.width(), tile.height());
  film_.publish(tile, slots_, samples, stages_);
}

}  // namespace glint
