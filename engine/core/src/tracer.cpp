#include "tracer.h"

#include "math.h"
#include "timer.h"

namespace glint {
namespace {

constexpr size_t kMaxBatch = 8192;  // rays in flight at once

}  // namespace

Tracer::Tracer(const Scene& scene, const RenderPlan& plan, Film& film, const std::atomic<bool>& cancel)
    : scene_(scene), plan_(plan), film_(film), stages_(best_stages()), cancel_(cancel), camera_(scene), shader_(scene, plan),
      direct_(scene, plan, stages_, cancel), batch_(scene, film.passes()) {}

Queue Tracer::take(uint32_t visibility) {
  if (spare_.empty()) return Queue(visibility);
  Queue queue = std::move(spare_.back());
  spare_.pop_back();
  queue.visibility = visibility;
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

void Tracer::camera_rays(uint32_t sample) {
  const size_t count = tile_->pixels();
  first_.start_at_camera(count, sample == 0 && film_.wants_data());
  const double* offset = plan_.pixel_offsets + 2 * size_t(sample);
  CameraStage stage = camera_.stage(plan_.region.x0 + tile_->x0, plan_.region.y0 + tile_->y0, offset[0], offset[1]);
  stage.count = count, stage.column = slots_.columns(), stage.row = slots_.rows();
  Columns& c = first_.columns;
  for (size_t k = 0; k < 3; ++k) stage.o[k] = c[Queue::kO + k], stage.d[k] = c[Queue::kD + k];
  stage.t_min = c[Queue::kTMin], stage.t_max = c[Queue::kTMax];
  stages_.camera(stage);
  const Vec3d eye = camera_.eye();
  for (size_t k = 0; any(eye) && k < 3; ++k)
    for (size_t i = 0; i < count; ++i) c[Queue::kO + k][i] = (stage.parallel ? c[Queue::kO + k][i] : 0) + eye[int(k)];
  for (size_t k = 0; (stage.parallel || any(eye)) && k < 3; ++k) std::copy_n(c[Queue::kO + k], count, c[Queue::kStart + k]);
  counts_.camera += count;
}

void Tracer::trace(const Tile& tile, uint32_t sample) {
  tile_ = &tile;
  slots_.set(tile.width(), tile.height());
  camera_rays(sample);
  Queue straight = take(kCamera), bounced = take(kMirror);
  process(first_, sample, straight, bounced);
  wait(std::move(straight)), wait(std::move(bounced));
  while (!waiting_.empty() && !cancel_) {
    Queue queue = std::move(waiting_.back());
    waiting_.pop_back();
    straight = take(kCamera), bounced = take(kMirror);
    process(queue, sample, queue.visibility == kCamera ? straight : bounced, bounced);
    wait(std::move(straight)), wait(std::move(bounced));
    give(std::move(queue));
  }
  waiting_.clear();
}

void Tracer::process(const Queue& queue, uint32_t sample, Queue& straight, Queue& bounced) {
  batch_.begin(queue);
  find_points(queue);
  shade(queue, straight, bounced);
  if (sample == 0 && queue.visibility == kCamera && film_.wants_data()) record(queue);
  direct_.illuminate(batch_, sample, counts_);
  keep(queue);
}

void Tracer::find_points(const Queue& queue) {
  {
    const Timer timer(counts_.tracing);
    scene_.accel().closest(queue.rays(), batch_.hits());
  }
  SurfaceStage stage{};
  stage.count = queue.size(), stage.points = batch_.points;
  for (size_t c = 0; c < 3; ++c) stage.start[c] = queue.columns[Queue::kStart + c], stage.d[c] = queue.columns[Queue::kD + c];
  stage.instance = batch_.instance.data(), stage.primitive = batch_.primitive.data(), stage.u = batch_.u.data(), stage.v = batch_.v.data();
  stage.instances = scene_.instance_shapes.data(), stage.groups = scene_.group_shapes.data();
  stage.missed = scene_.transparent_film && queue.visibility == kCamera ? scene_.nothing() : scene_.surroundings();
  stages_.surface(stage);
  for (size_t k = 0; !scene_.only_meshes && k < queue.size(); ++k) {
    if (batch_.material[k] != kNoMaterial) continue;
    const Path path = queue.path(k);
    batch_.set_surface(k, surface_at(scene_, path.start, queue.ray(k).d, batch_.hit(k)));
    const GlintInstances& group = scene_.group(batch_.instance[k]);
    batch_.material[k] = group.flags & GLINT_HOLDOUT ? scene_.holdout() : scene_.material_of(group, batch_.primitive[k]);
  }
}

void Tracer::shade(const Queue& queue, Queue& straight, Queue& bounced) {
  ShadeStage stage{};
  stage.count = queue.size(), stage.material = batch_.material.data(), stage.terms = scene_.material_terms.data();
  stage.specular_terms = scene_.specular_terms.data(), stage.max_specular = scene_.max_specular, stage.sums = batch_.sums;
  for (size_t c = 0; c < 3; ++c) stage.T[c] = queue.columns[Queue::kT + c], stage.diffuse[c] = batch_.diffuse[c];
  stage.specular = batch_.specular, stage.stride = batch_.stride, stage.lit = batch_.lit.data(), stage.others = batch_.others.data();
  const size_t others = stages_.shade(stage);
  for (size_t k = 0; (scene_.features & GLINT_FEATURE_SEEN_LIGHTS) && k < queue.size(); ++k) shader_.seen_lights(batch_, k);
  double* lost = film_.lost_alpha(*tile_);
  for (size_t k = 0; scene_.transparent_film && queue.visibility == kCamera && k < queue.size(); ++k)
    if (batch_.missed(k)) lost[queue.slots[k]] += mean(queue.path(k).T);
  for (size_t i = 0; i < others; ++i) {
    const uint32_t k = batch_.others[i];
    shader_.hit(batch_, k, film_, pixel(queue, k), lost[queue.slots[k]], {straight, bounced}, counts_);
  }
}

/// Data passes of the hits that the shader did not look at.
void Tracer::record(const Queue& queue) {
  for (size_t k = 0; k < queue.size(); ++k)
    if (queue.wants_data[k] && !batch_.missed(k) && !scene_.material_terms[batch_.material[k]].others)
      shader_.record(batch_, k, film_, pixel(queue, k));
}

/// The batch's sums to those of the film.
void Tracer::keep(const Queue& queue) {
  auto keep_part = [&](int part, double* const (&columns)[3]) {
    double* sums = film_.sums(*tile_, part);
    for (size_t c = 0; sums && columns[0] && c < 3; ++c, sums += tile_->stride()) {
      if (&queue == &first_) stages_.add(sums, columns[c], queue.size());
      else for (size_t k = 0; k < queue.size(); ++k) sums[queue.slots[k]] += columns[c][k];
    }
  };
  const SumColumns& s = batch_.sums;
  keep_part(GLINT_PASS_COMBINED, s.total);
  if (queue.visibility != kCamera) return keep_part(GLINT_PASS_MIRROR, s.total);
  keep_part(GLINT_PASS_AMBIENT, s.ambient), keep_part(GLINT_PASS_EMISSION, s.emission), keep_part(GLINT_PASS_ENVIRONMENT, s.environment);
  keep_part(GLINT_PASS_DIFFUSE, s.diffuse), keep_part(GLINT_PASS_SPECULAR, s.specular), keep_part(GLINT_PASS_SHADOW, s.shadow);
}

void Tracer::publish(const Tile& tile, uint32_t samples) {
  slots_.set(tile.width(), tile.height());
  film_.publish(tile, slots_, samples, stages_);
}

}  // namespace glint
