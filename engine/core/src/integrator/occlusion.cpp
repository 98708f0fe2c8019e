// How much of an even sky is open over what camera rays meet (semantics/passes.md). Letters: x
// point, n shading normal, t1 t2 across it, l direction.
#include "integrator/tracer.h"
#include "math/math.h"
#include "scene/surface.h"
#include "system/timer.h"

namespace glint {
namespace {

/// Two unit vectors across n, which turn steadily with it but where it is along (1, 2, 3).
struct Across {
  Vec3d t1, t2;
  explicit Across(Vec3d n) {
    const Vec3d t = cross(Vec3d{1, 2, 3}, n);
    t1 = unit(any(t) ? t : cross(Vec3d{1, 0, 0}, n));
    t2 = cross(n, t1);
  }
};

}  // namespace

/// Rays from the points in the direction over `place`, as far as occlusion looks.
void LitBatch::aim_around(const std::vector<uint32_t>& at, const double* place) {
  const double reach = scene.anchor.scale * scene.world.occlusion_distance;
  const double height = std::sqrt(std::max(0.0, 1 - place[0] * place[0] - place[1] * place[1]));
  for (size_t k = 0; k < at.size(); ++k) {
    const Vec3d n = row(points.n, at[k]);
    const Across across(n);
    const Vec3d l = place[0] * across.t1 + place[1] * across.t2 + height * n;
    point_[k] = at[k];
    const Vec3d origin = start_towards(at[k], l);
    if (rays.start[0]) set_row(rays.start, k, origin);
    set_row(rays.o, k, shadow_start(at[k], origin, origin + l));
    set_row(rays.to, k, l);
    rays.t_max[k] = reach;
  }
}

void LitBatch::ambient_occlusion(const Batch& batch, const std::vector<uint32_t>& at,
                                 uint32_t sample, std::vector<Vec3d>& sky) {
  const size_t count = at.size();
  const uint32_t each = plan.occlusion_directions.each;
  if (!(scene.world.occlusion_distance > 0)) return sky.assign(count, {1, 1, 1});
  sky.assign(count, {});
  const bool dims = scene.features & GLINT_FEATURE_MEDIA;
  const Rays sent = shadow_rays(count);
  const double* place = plan.occlusion_directions.row(sample, 0);
  for (uint32_t j = 0; j < each && !cancel; ++j, place += 2) {
    aim_around(at, place);
    for (size_t k = 0; batch.cost && k < count; ++k) batch.charge(at[k]);
    if (glassy_) {
      transparent_shadows_.trace(rays, LightShape::kDome, scene.trees.opacity(), zeros_, count,
                                 shadow_, counts);
    } else {
      const Timer timer(counts.tracing);
      scene.trees.accel().occluded(sent, blocked_.data(), scratch);
      counts.shadow += count;
    }
    if (dims) {
      media_.find(sent, counts);
      media_.march(sent, rays.t_max, sample, RayKind::kShadow, counts);
    }
    for (size_t k = 0; k < count; ++k) {
      Vec3d S = open(k);
      if (dims) S = media_.passed(k, 0, rays.t_max[k]) * S;
      sky[k] += 1.0 / each * S;
    }
  }
}

/// What the passes of the queue's paths have of the points that they meet.
void Tracer::note_occlusion(const Queue& queue) {
  find_asked(queue);
  if (occlusion_rows_.empty()) return;
  direct_.lit.ambient_occlusion(batch_, occlusion_rows_, sample_, open_);
  add_asked(queue, paths_.sums(film_, GLINT_PASS_AMBIENT_OCCLUSION));
  note_asked(queue);
}

/// How much is asked of what the queue's rays meet.
void Tracer::note_asked(const Queue& queue) {
  find_asked(queue);
  open_.assign(occlusion_rows_.size(), {1, 1, 1});
  if (double* const whole = paths_.sums(film_, kUnhidden)) add_asked(queue, whole);
}

void Tracer::find_asked(const Queue& queue) {
  occlusion_rows_.clear();
  for (uint32_t k = 0; k < queue.size(); ++k)
    if (batch_.material[k] < scene_.materials.size() && !is_caught(queue, k))
      occlusion_rows_.push_back(k);
}

/// To sums of the paths what is open over those, as much as stays of the rays there.
void Tracer::add_asked(const Queue& queue, double* sums) {
  for (size_t i = 0; i < occlusion_rows_.size(); ++i) {
    const uint32_t k = occlusion_rows_[i];
    const Vec3d T = queue.path(k).T, passed = shader_.passed(batch_, k);
    for (int c = 0; c < 3; ++c)
      sums[size_t(c) * paths_.stride() + queue.slot(k)] +=
          T[c] * (1 - std::clamp(passed[c], 0.0, 1.0)) * open_[i][c];
  }
}

}  // namespace glint
