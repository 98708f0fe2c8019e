// What the points that rays meet add to the picture before lights, and the rays that go on from
// them: constant materials all at once, others material by material.
#include <algorithm>
#include <cmath>

#include "integrator/tracer.h"

namespace glint {

void Tracer::shade(const Queue& queue, Queue& straight, Queue& bounced) {
  const size_t others = stages_.shade(batch_.shading());
  const bool sees_lights =
      scene_.features & GLINT_FEATURE_VISIBLE_LIGHTS && queue.past.reflections == 0;
  for (size_t c = 0; batch_.has_groups() && c < 3; ++c)
    std::copy_n(batch_.sums.emission[c], queue.size(), batch_.glow[c]);
  for (size_t k = 0; sees_lights && k < queue.size(); ++k) see_lights(k);
  double* lost = paths_.lost_alpha();
  for (size_t k = 0;
       scene_.world.transparent_film && queue.visibility == kCamera && k < queue.size(); ++k)
    if (batch_.missed(k)) lost[queue.slot(k)] += mean(queue.path(k).T);
  for (size_t i = 0; i < others;) {
    const uint32_t k = batch_.others[i];
    if (batch_.material[k] == scene_.materials.surroundings()) i += see_sky(queue, i, others - i);
    else i += vary(queue, i, others - i, {straight, bounced});
  }
  // infinite weights times nothing are not nothing
  for (size_t k = 0; &queue != &first_ && k < queue.size(); ++k)
    if (batch_.missed(k)) batch_.lit[k] = 0;
}

/// Adds the lights' own shapes that ray k sees.
void Tracer::see_lights(size_t k) {
  if (scene_.features & GLINT_FEATURE_VISIBLE_LIGHTS)
    shader_.seen_lights(batch_, k, scene_.features & GLINT_FEATURE_MEDIA ? &media_ : nullptr,
                        clear_.data());
}

/// How points of a material that varies are evaluated, but for which they are.
EvaluateStage Tracer::varying(const Queue& queue, const Material& material) {
  EvaluateStage stage = batch_.evaluation(material, program_slots_.data());
  stage.dark = queue.past.reflections > 0 && scene_.features & GLINT_FEATURE_MESH_LIGHT;
  stage.thrown = queue.gathers() && plan_.reflective_caustics ? RenderPlan::kThrownExponent : 0;
  for (size_t c = 0; batch_.has_groups() && c < 3; ++c) stage.sums.emission[c] = batch_.glow[c];
  if (stage.program && stage.program->asks_rays)
    stage.queries = queries_.at(batch_, sample_, counts_);
  return stage;
}

/// Shades those of the batch's `others` from `first` on, of `count`, that share its material. How
/// many they are.
size_t Tracer::vary(const Queue& queue, size_t first, size_t count, const Leaving& next) {
  const uint32_t* rows = batch_.others + first;
  const Material& material = scene_.materials[batch_.material[rows[0]]];
  EvaluateStage stage = varying(queue, material);
  while (stage.count < count && batch_.material[rows[stage.count]] == batch_.material[rows[0]])
    ++stage.count;
  stage.rows = rows;
  pass_on(queue, stages_.vary(stage), next);
  for (size_t i = 0; batch_.has_groups() && i < stage.count; ++i)
    Batch::add_to(batch_.sums.emission, rows[i], row(batch_.glow, rows[i]));
  for (size_t i = 0; film_.wants_data() && material.passing > 0 && i < stage.count; ++i)
    if (queue.wants_data(rows[i]))
      shader_.record_transparent(batch_, rows[i], film_, pixel(queue, rows[i]));
  return stage.count;
}

/// Adds what the world's program gives to those of the batch's `others` from `first` on, of
/// `count`, that hit nothing. How many they are.
size_t Tracer::see_sky(const Queue& queue, size_t first, size_t count) {
  const uint32_t* rows = batch_.others + first;
  size_t seen = 0;
  while (seen < count && batch_.material[rows[seen]] == scene_.materials.surroundings()) {
    const uint32_t* some = rows + seen;
    const size_t most = std::min(count - seen, kBlock);
    size_t here = 1;
    while (here < most && batch_.material[some[here]] == scene_.materials.surroundings()) ++here;
    const double* const slot = run_sky(queue, some, here);
    for (size_t i = 0; i < here; ++i)
      for (size_t c = 0; c < 3; ++c) {
        const double radiance = slot[c * kBlock + i], T = queue.T[c][some[i]];
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
  const ProgramView& view = *scene_.input_tables().view;
  const bool from_rays = view.parallel && kind == RayKind::kCamera;
  ProgramPoints points{};
  for (size_t i = 0; i < (count + kPad - 1) / kPad * kPad; ++i) {
    const uint32_t k = rows[std::min(i, count - 1)];
    points.outside[i] = -1;
    points.tags[i] = queue.tags[k];
    const Vec3d o = queue.ray(k).o, d = queue.ray(k).d;
    const double far = view.scale / length(d);
    for (int c = 0; c < 3; ++c)  // what the camera sees of the direction
      points.x[c][i] =
          (from_rays ? o[c] : view.scale * (view.eye[c] - view.origin[c])) + far * d[c];
    for (size_t c = 0; c < 3; ++c) points.d[c][i] = 0;
    for (size_t c = 0; c < 3; ++c)
      for (size_t axis = 0; axis < 3; ++axis)
        points.d[axis][i] += scene_.world.sky_axes[axis][int(c)] * d[int(c)];
  }
  stages_.program({scene_.input_tables(), scene_.world.sky_program, &points, kind, count,
                   program_slots_.data(), nullptr});
  return program_slots_.data() + scene_.world.sky_slot;
}

/// Sends on the rays of the first `count` of the batch's `passing_rows`, which share a material.
void Tracer::pass_on(const Queue& queue, size_t count, const Leaving& next) {
  uint32_t* const all = batch_.passing_rows;
  size_t shown = count;  // those beyond are on catchers and holdouts
  if (catches_)
    shown = size_t(
        std::stable_partition(all, all + count, [&](uint32_t k) { return !is_caught(queue, k); }) -
        all);
  if (queue.visibility == kCamera) cut_holes(queue, all, shown);
  for (size_t first = 0, some; first < count; first += some) {
    const size_t end = first < shown ? shown : count;
    some = cuts_.leading(queue, all + first, end - first);
    shader_.pass_on(batch_, sample_, all + first, some, next, counts_,
                    first >= shown || queue.gathers());
  }
}

/// What HOLDOUT lobes take out of the picture at the points of `rows`, which share a material.
void Tracer::cut_holes(const Queue& queue, const uint32_t* rows, size_t count) {
  if (count == 0 || !scene_.materials[batch_.material[rows[0]]].has(GLINT_HOLDOUT_LOBE)) return;
  double* const lost = paths_.lost_alpha();
  for (size_t i = 0; i < count; ++i)
    lost[queue.slot(rows[i])] +=
        mean(queue.path(rows[i]).T * shader_.passed(batch_, rows[i], GLINT_HOLDOUT_LOBE));
}

/// Highlights that rough surfaces show of others are no narrower than their own lobes: points of
/// lights would be dots in them. To what is matt they show none without caustics.
void Tracer::widen(const Queue& queue) {
  if (queue.gathers() && !plan_.reflective_caustics) return shader_.dull(batch_);
  const bool shaped =
      scene_.materials.rows_of_lobes.of[GLINT_SPECULAR].width >= MicrofacetRow::kShaped;
  for (size_t k = 0; k < queue.size(); ++k) {
    const double widest = queue.path(k).widest();
    for (int number = 0; number < batch_.highlights(); ++number) {
      double* const column = batch_.lobe_row(GLINT_SPECULAR, number) + k;
      double& exponent = column[MicrofacetRow::kExponent * batch_.stride];
      if (!(exponent > widest)) continue;
      // as bright in all: by the integral of what half vectors are drawn by
      const double more =
          shaped && column[MicrofacetRow::kDistribution * batch_.stride] > 0 ? 2 : 1;
      for (size_t c = 0; c < 3; ++c)
        column[c * batch_.stride] *= (widest + more) / (exponent + more);
      exponent = widest;
    }
  }
}

}  // namespace glint
