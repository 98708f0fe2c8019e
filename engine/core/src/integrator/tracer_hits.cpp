// The tracer's rays to the points that they meet: camera rays, closest hits, surfaces, and what
// media before these leave of the rays.
#include <algorithm>

#include "integrator/tracer.h"
#include "math/math.h"
#include "system/timer.h"

namespace glint {

/// The queue's camera rays hit nothing, and nobody asks where they lead.
void Tracer::miss(const Queue& queue) {
  std::fill_n(batch_.instance, queue.size(), Hit::kNone);
  std::fill_n(batch_.material, queue.size(), missed(queue));
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
  std::copy_n(first_.o, 3, stage.o);
  std::copy_n(first_.d, 3, stage.d);
  stage.t_min = first_.t_min;
  stage.t_max = first_.t_max;
  stage.latest = &camera_ends_.latest;
  stage.earliest = &camera_ends_.earliest;
  stages_.camera(stage);
  camera_.clip(stage);
  const Vec3d eye = plan_.camera_frames ? Vec3d{} : camera_.eye();  // frames have their own
  const bool beside = !camera_.has_one_eye() || plan_.is_spread();
  // What the kernels need not find out.
  from_eye_ = !beside && !plan_.camera_frames && !stage.panorama && !camera_.clips() &&
              stage.clip_start >= 0 && camera_ends_.latest < camera_ends_.earliest;
  for (size_t k = 0; any(eye) && k < 3; ++k)
    for (size_t i = 0; i < stage.count; ++i)
      stage.o[k][i] = (beside ? stage.o[k][i] : 0) + eye[int(k)];
  for (size_t k = 0; (beside || any(eye)) && k < 3; ++k)
    std::copy_n(stage.o[k], stage.count, first_.start[k]);
  if (stage.panorama) leave_out_unseen(stage);
}

/// Beyond the picture of a panorama's lens rays bring nothing: it is black there.
void Tracer::leave_out_unseen(const CameraStage& stage) {
  for (size_t k = 0; k < stage.count; ++k) {
    const double seen = stage.t_max[k] >= 0 ? 1 : 0;
    set_row(first_.T, k, {seen, seen, seen});
  }
}

void Tracer::find_hits(const Queue& queue) {
  if (queue.exits) {
    for (size_t k = 0; k < queue.size(); ++k) {
      const Hit& hit = queue.hit(k);
      batch_.t[k] = hit.t;
      batch_.instance[k] = hit.instance;
      batch_.primitive[k] = hit.primitive;
      batch_.u[k] = hit.u;
      batch_.v[k] = hit.v;
    }
    return;
  }
  if (batch_.first_hits && batch_.first_hits->look_up(*tile_, batch_.hits())) return;
  {
    const Timer timer(counts_.tracing);
    Rays rays = queue.rays();
    if (&queue == &first_ && from_eye_) rays.ends = &camera_ends_;
    // Every surface counts for what is remembered, and for passes that tell of holes as of other
    // surfaces.
    const bool all = batch_.first_hits || film_.wants(GLINT_PASS_COST) ||
                     film_.wants(GLINT_PASS_GAP) || film_.wants(GLINT_PASS_AOV);
    rays.opacity = all ? nullptr : scene_.trees.opacity();
    if (queue.past.caught == Queue::Past::kAlone) rays.opacity = scene_.trees.opacity_of_catchers();
    const bool straight = rays.opacity && queue.visibility == kCamera && &queue != &first_;
    if (straight && !batch_.fallbacks) ahead_.closest(queue, batch_.hits());
    else scene_.trees.accel().closest(rays, batch_.hits(), scratch_);
  }
  batch_.charge_fallbacks();
  if (&queue == &first_) counts_.camera += queue.size();
  if (batch_.first_hits) batch_.first_hits->keep(*tile_, batch_.hits());
}

void Tracer::find_points(const Queue& queue) {
  if (surely_empty_) return miss(queue);
  find_hits(queue);
  batch_.find_points(stages_, missed(queue));
  for (size_t k = 0; queue.past.reflections > 0 && k < queue.size(); ++k)
    if (batch_.missed(k) && queue.skyless(k)) batch_.material[k] = scene_.materials.nothing();
}

/// How far behind the first hits of the camera rays the next ones lie.
void Tracer::find_gaps(const Queue& queue) {
  if (!is_first_ || &queue != &first_) return;
  std::vector<Ray> rays;
  std::vector<uint32_t> from;
  for (uint32_t k = 0; k < first_.size(); ++k) {
    if (batch_.missed(k) || !paths_.is_first(k)) continue;
    rays.push_back(first_.ray(k));
    from.push_back(k);
    rays.back().t_min = beyond(batch_.t[k]);
  }
  std::vector<Hit> hits(rays.size());
  scene_.trees.accel().closest(rays.data(), hits.data(), rays.size(), scratch_);
  for (size_t i = 0; i < hits.size(); ++i) {
    if (hits[i].instance != Hit::kNone)
      film_.set_gap(pixel(first_, from[i]), (hits[i].t - batch_.t[from[i]]) / scene_.anchor.scale);
  }
}

/// What media before their hits leave of the rays' weights.
void Tracer::dim(Queue& queue) {
  const Rays rays = queue.rays();
  media_.find(rays, counts_);
  clear_.resize(queue.size());
  if (media_.empty()) {
    for (size_t k = 0; k < queue.size(); ++k) clear_[k] = queue.path(k).T;
    return;
  }
  ends_.resize(queue.size());
  for (size_t k = 0; k < queue.size(); ++k) ends_[k] = batch_.missed(k) ? kInfinity : batch_.t[k];
  media_.march(rays, ends_.data(), sample_,
               queue.visibility == kCamera ? RayKind::kCamera : RayKind::kBounced, counts_);
  if (scene_.media.scatters) media_.sum_depths();
  for (size_t k = 0; k < queue.size(); ++k) {
    clear_[k] = queue.path(k).T;
    set_row(queue.T, k, media_.passed(k, rays.t_min[k], ends_[k]) * clear_[k]);
  }
}

}  // namespace glint
