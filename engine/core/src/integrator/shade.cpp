// Letters: d ray direction, n shading normal, g geometric normal, T weight to the pixel.
#include "integrator/shade.h"

#include <algorithm>

#include "math/math.h"
#include "scene/light_program.h"
#include "shading/closure/distributions.h"
#include "shading/stage_bump.h"

namespace glint {
namespace {

constexpr uint32_t kMostLevels = 64;    // of lobe points
constexpr uint32_t kMaxStraight = 128;  // surfaces in a row that dim a transparent ray

/// What a stage reads of a batch's points of one material and of the rays that arrived there, with
/// room for what leaves.
PassStage stage_of(const MaterialTable& materials, const Batch& batch, const uint32_t* rows,
                   size_t count, const Leaving& next) {
  const Material& material = materials[batch.material[rows[0]]];
  PassStage stage = batch.stage<PassStage>();
  stage.rows = rows;
  stage.count = count;
  stage.lobes = materials.lobes.data() + material.first_lobe;
  stage.lobe_count = material.lobe_count;
  stage.max_straight = kMaxStraight;
  // rough glass refracts and mirrors
  const size_t most = size_t(material.passing) * (material.is_rough_glass ? 2 : 1);
  next.bounced.reserve(next.bounced.size() + count * most);
  if (&next.straight != &next.bounced) next.straight.reserve(next.straight.size() + count);
  stage.straight = next.straight.end();
  stage.bounced = next.bounced.end();
  return stage;
}

}  // namespace

void Shader::pass_on(const Batch& batch, uint32_t sample, const uint32_t* rows, size_t count,
                     const Leaving& next, RayCounts& counts, bool straight_alone) const {
  const Material& material = scene_.materials[batch.material[rows[0]]];
  PassStage stage = stage_of(scene_.materials, batch, rows, count, next);
  stage.max_bounces = straight_alone ? 0 : plan_.max_bounces;
  stage.cutoff = plan_.cutoff;
  stage.shares = plan_.clamp_indirect > 0;
  if (plan_.interleaving > 1) {
    stage.splits = RenderPlan::kSplits;
    stage.least = RenderPlan::kLeastWeight;
    stage.choice = 0.6180339887498949 * sample;
  }
  DiscPlace places[kMostLevels];
  if (material.is_rough_glass) {
    stage.places = places;
    stage.levels = std::min(plan_.lobe_levels, kMostLevels);
    for (uint32_t level = 0; level < stage.levels; ++level) {
      const double* const point = plan_.lobe_point(sample, level);
      places[level] = disc_place(point[0], point[1]);
    }
    for (size_t k = 0; batch.soft_light && k < count; ++k)
      if (batch.queue->path(rows[k]).depth < stage.max_bounces)
        batch.mark_soft_light(rows[k], Refinement::kCut);
  }
  const PassedRays passed = stages_.pass(stage);
  counts.refraction += passed.refraction;
  counts.mirror += passed.mirror;
  counts.transparent += passed.transparent;
}

void Shader::send_all(const Batch& batch, const uint32_t* rows, size_t count,
                      const Leaving& next) const {
  PassStage stage = stage_of(scene_.materials, batch, rows, count, next);
  stage.max_bounces = plan_.max_bounces;
  const DiscPlace middle = disc_place(0, 0);
  stage.places = &middle;
  stage.levels = 1;
  stages_.pass(stage);
}

Vec3d Shader::passed(const Batch& batch, size_t k, int kind) const {
  const Material& material = scene_.materials[batch.material[k]];
  Vec3d sum;
  const LobeShape* lobe = scene_.materials.lobes.data() + material.first_lobe;
  for (int i = 0; i < material.passing; ++lobe) {
    if (lobe->kind == kind) sum += batch.passing_term(k, i);
    i += (1u << lobe->kind & kPassing) != 0;
  }
  return sum;
}

Gives Shader::gives(const Batch& batch, size_t k) const {
  const Material& material = scene_.materials[batch.material[k]];
  const Vec3d d = batch.queue->ray(k).d, n = row(batch.n, k), g = row(batch.g, k);
  Gives gives;
  const LobeShape* lobe = scene_.materials.lobes.data() + material.first_lobe;
  for (int i = 0; i < material.passing; ++lobe) {
    if (!(1u << lobe->kind & kPassing)) continue;
    const int own = i++;
    const bool mirrors = lobe->kind == GLINT_MIRROR, refracts = lobe->kind == GLINT_REFRACTION;
    const Vec3d coefficient = batch.passing_term(k, own);
    if (!(mirrors || refracts) ||
        !(coefficient[0] != 0 || coefficient[1] != 0 || coefficient[2] != 0))
      continue;
    double R = 0;
    if (lobe->fresnel) {
      const bool straight = batch.outside[k] || lobe->fresnel & GLINT_BOTH_SIDES;
      const double given = batch.passing_ior(k, own, lobe->ior), ior = straight ? given : 1 / given;
      const Vec3d m = batch.passing_normal(k, own, n);
      const Three at = lifted(splat3(&m.x), splat3(&g.x), -splat3(&d.x));
      const Doubles cosine = splat(-dot(at, splat3(&d.x))[0]);
      R = (lobe->fresnel & GLINT_SCHLICK ? schlick_weight(cosine)
                                         : fresnel_reflectance(cosine, splat(ior)))[0];
    }
    if (mirrors) gives.mirrored += (lobe->fresnel ? R : 1) * coefficient;
    if (!refracts) continue;
    gives.refracted += (1 - R) * coefficient;
    if (!(lobe->exponent > 0 && batch.passing_exponent(k, own, lobe->exponent) > 0))
      gives.clear += (1 - R) * coefficient;
  }
  return gives;
}

void Shader::dull(const Batch& batch) const {
  const MaterialTable& all = scene_.materials;
  for (size_t k = 0; k < batch.size(); ++k) {
    const double cosine = -dot(batch.queue->ray(k).d, row(batch.n, k)),
                 seen = std::clamp(cosine, 0.0, 1.0);
    Vec3d kept{};
    const auto each = [&](int kind, int count, auto body) {
      for (int number = 0; number < count; ++number) {
        double* const row = batch.lobe_row(kind, number) + k;
        body([&](int of) -> double& { return row[size_t(of) * batch.stride]; });
        for (size_t c = 0; c < 3; ++c) row[c * batch.stride] = 0;
      }
    };
    each(GLINT_SPECULAR, batch.highlights(), [&](auto at) {
      if (!all.has_varnish || !(at(MicrofacetRow::kMasking) > 0 && at(MicrofacetRow::kFresnel) > 0))
        return;
      kept += of_even_light(splat(seen), splat(at(MicrofacetRow::kExponent)),
                            splat(at(MicrofacetRow::kMasking)), splat(at(MicrofacetRow::kFresnel)),
                            splat(at(MicrofacetRow::kDistribution)))[0] *
              Vec3d{at(0), at(1), at(2)};
    });
    each(GLINT_TOON_SPECULAR, all.rows_of_lobes.of[GLINT_TOON_SPECULAR].count, [](auto) {});
    const Vec3d T = batch.queue->path(k).T;
    for (int c = 0; c < 3; ++c)
      if (T[c] != 0 && kept[c] != 0) batch.diffuse[c][k] *= 1 + kept[c] / T[c];
  }
}

void Shader::record_transparent(const Batch& batch, size_t k, Film& film, uint32_t pixel) const {
  if (mean(passed(batch, k)) < 0.5) record(batch, k, film, pixel);
}

/// What goes straight through the surface of a point that no stage has seen.
Vec3d Shader::transparency(const Batch& batch, size_t k, const Material& material) const {
  Vec3d sum;
  if (!material.has(GLINT_TRANSPARENT)) return sum;
  const Path path = batch.queue->path(k);
  ProgramPoints points;
  for (size_t i = 0; i < kPad; ++i)
    set_point(points, i, scene_, batch.surface(k), path.start, batch.queue->ray(k).d,
              batch.queue->tags[k]);
  std::vector<double> slots(material.program > 0 ? scene_.programs.most_slots * kBlock : 0);
  if (material.program > 0)
    stages_.program({scene_.input_tables(), scene_.programs.of(material.program), &points,
                     path.depth > 0 ? RayKind::kBounced : RayKind::kCamera, 1, slots.data(),
                     nullptr});
  double color[3][kPad];
  const LobeShape* const lobes = scene_.materials.lobes.data() + material.first_lobe;
  for (uint32_t l = 0; l < material.lobe_count; ++l) {
    if (lobes[l].kind != GLINT_TRANSPARENT) continue;
    stages_.coefficients({scene_.input_tables(),
                          &points,
                          1,
                          slots.data(),
                          lobes + l,
                          {color[0], color[1], color[2]}});
    sum += {color[0][0], color[1][0], color[2][0]};
  }
  return sum;
}

void Shader::record(const Batch& batch, size_t k, Film& film, uint32_t pixel) const {
  const Surface s = batch.surface(k);
  record(film, pixel, s, scene_.materials[batch.material[k]], batch.queue->ray(k).d);
}

void Shader::record(Film& film, uint32_t pixel, const Surface& s, const Material& material,
                    Vec3d d) const {
  film.set_data(pixel, {camera_.depth(s.x), std::fabs(dot(s.n, d)), scene_.anchor.world(s.x), s.n,
                        film.wants(GLINT_PASS_UV) ? uv_at(scene_, s) : Vec3d{},
                        scene_.instances.group(s.instance).object_index, material.index});
  if (film.wants(GLINT_PASS_VECTOR) && plan_.neighbours) {
    double motion[4];
    motion_vectors_.at(s, motion);
    film.set_vector(pixel, motion);
  }
}

void Shader::seen_lights(Batch& batch, size_t k, const MediaSpans* media,
                         const Vec3d* clear) const {
  const Ray ray = batch.queue->ray(k);
  const Path path = batch.queue->path(k);
  const double t = batch.missed(k) ? kInfinity : batch.t[k];
  const uint32_t flag = batch.queue->visibility == kTransmission ? GLINT_SEEN_BY_TRANSMISSION
                        : path.depth > 0                         ? GLINT_SEEN_BY_MIRROR
                                                                 : GLINT_SEEN_BY_CAMERA;
  for (const Light& light : scene_.lights) {
    if (!(light.flags & flag)) continue;
    double meets = light.meets(ray.o, ray.d);
    bool before = light.endless()
                      ? meets > 0 && t == kInfinity
                      : meets > path.from && meets > ray.t_min && meets < std::min(t, ray.t_max);
    if (!before) continue;
    Vec3d T = media ? media->passed(k, ray.t_min, meets) * clear[k] : path.T;
    if (light.program) {
      LightProgram program(scene_, stages_);
      const Vec3d end = light.seen_point(ray.o, ray.d, meets);
      for (size_t i = 0; i < kPad; ++i) program.put(light, i, ray.o, ray.d, end);
      program.run(light, path.depth > 0 ? RayKind::kBounced : RayKind::kCamera, 1);
      T = T * program.share(light, 0);
    }
    const Vec3d seen = T * light.radiance(ray.o, ray.d, plan_.physical());
    batch.add(k, batch.sums.emission, seen);
    batch.add_to_group(light.group, k, seen);
  }
}

}  // namespace glint
