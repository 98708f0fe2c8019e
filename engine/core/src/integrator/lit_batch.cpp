#include "integrator/lit_batch.h"

#include <algorithm>

#include "math/math.h"
#include "system/timer.h"

namespace glint {
namespace {

/// zeros, o, to, t_max, starts, ends, diffuse, specular, shadow, pdf
constexpr size_t kColumns = 1 + 3 + 3 + 1 + 3 + 3 + 3 + 3 + 3 + 1;

/// So many more rays than points may wait to be traced at once.
constexpr size_t kTogether = 256;

}  // namespace

LitBatch::LitBatch(const LightContext& context)
    : LightContext(context),
      glassy_(scene.features & GLINT_FEATURE_TRANSPARENT),
      columns_(kColumns),
      program_(scene, stages),
      transparent_shadows_(scene, stages, cancel, scratch),
      media_(scene, scratch) {}

void LitBatch::begin(const Batch& batch, uint32_t sample, bool alone) {
  sample_ = sample;
  alone_ = alone;
  columns_.reserve(batch.size() + kTogether);
  point_.resize(columns_.rows());
  blocked_.resize(columns_.rows());
  size_t next = 0;
  auto three = [&](double*(&to)[3], bool wanted) {
    for (double*& column : to) column = wanted ? columns_[next++] : nullptr;
  };
  zeros_ = columns_[next++];
  rays.t_max = columns_[next++];
  rays.point = point_.data();
  three(rays.o, true);
  three(rays.to, true);
  three(rays.diffuse, true);
  three(rays.specular, batch.sums.diffuse[0]);
  three(ends_, true);
  three(shadow_, glassy_);
  three(rays.start, glassy_ && batch.origin[0] != batch.x[0]);
  rays.pdf = columns_[next++];
  static_cast<BatchColumns&>(points) = batch;
  std::copy_n(batch.origin, 3, rays.origin);
  points.count = batch.size();
  points.lobes.columns = batch.specular;
  points.lobes.stride = batch.stride;
  points.lobes.layout = &scene.materials.rows_of_lobes;
  points.lobes.highlights = batch.highlights();
  points.lobes.shown = plan.reflections == GLINT_REFLECT_ALL;
  points.lobes.shows_nothing = batch.queue->gathers();
  points.lobes.others = scene.materials.spans.data();
  points.lobes.other_count = scene.materials.other_count();
  points.lobes.has_fibre = scene.materials.has_fibre;
  points.lobes.turns = scene.materials.turns_lobes;
  points.lobes.stretches = scene.materials.stretches_lobes;
  points.lobes.edges = scene.materials.edges_lobes;
}

ShadowRays LitBatch::rays_from(size_t count) const {
  ShadowRays from = rays;
  from.point += count;
  from.t_max += count;
  from.pdf += count;
  for (double*(*const columns)[3] :
       {&from.o, &from.to, &from.start, &from.end, &from.diffuse, &from.specular})
    for (double*& column : *columns) column = column ? column + count : nullptr;
  return from;
}

void LitBatch::ask_ends(bool asks) {
  for (int c = 0; c < 3; ++c) rays.end[c] = glassy_ || asks ? ends_[c] : nullptr;
}

LightPolicy LitBatch::policy_of(const Light& light) const {
  LightPolicy policy = light.policy();
  policy.draws_diffuse &= !scene.materials.has_fibre;
  policy.power_heuristic = scene.instances.mirrors_differ;
  policy.most_exponent = scene.materials.most_exponent;
  return policy;
}

const int64_t* LitBatch::receivers(const Batch& batch, const Light& light,
                                   std::vector<int64_t>& mask) const {
  if (light.lights_all()) return batch.lit;
  mask.assign(batch.lit, batch.lit + batch.stride);
  for (size_t k = 0; k < batch.size(); ++k)
    if (mask[k] && !light.lights(scene.instances.group(batch.instance[k]).light_set)) mask[k] = 0;
  return mask.data();
}

/// Whether gloss shows some light as if it were matt at what the rays of a queue meet.
bool LitBatch::shows_even_gloss(const Queue& queue) const {
  const MaterialTable& all = scene.materials;
  return queue.gathers() ? all.has_toon_gloss || all.has_gloss || all.has_mirrors
                         : all.has_even_gloss(plan.reflections == GLINT_REFLECT_ALL);
}

void LitBatch::add(const Batch& batch, const Light& light, const LightSample& from, size_t count,
                   uint8_t* known) {
  if (count == 0) return;
  if (light.program) apply_program(light, count);
  const bool casts = hides && light.casts_shadow();
  if (hides) charge(batch, count, from.count > 1 && !light.is_dome(), casts);
  trace(light, from.shape, count, casts, known);
  add_to_sums(batch, count);
}

void LitBatch::charge(const Batch& batch, size_t count, bool soft, bool casts) const {
  for (size_t k = 0; batch.soft_light && soft && k < count; ++k)
    batch.mark_soft_light(point_[k], Refinement::kReached);
  for (size_t k = 0; batch.cost && casts && k < count; ++k) batch.charge(point_[k]);
}

void LitBatch::trace(const Light& light, LightShape shape, size_t count, bool casts,
                     uint8_t* known) {
  if (!hides) {
    std::fill_n(blocked_.begin(), count, uint8_t(0));
    for (size_t c = 0; shadow_[0] && c < 3; ++c) std::fill_n(shadow_[c], count, 1.0);
    return;
  }
  if (casts && glassy_ && !known) {
    transparent_shadows_.trace(rays, shape, opacity(light), zeros_, count, shadow_, counts,
                               visibility);
  } else {
    if (casts) find_shadows(light, count, known);
    else std::fill_n(blocked_.begin(), count, uint8_t(0));
    if (glassy_)
      transparent_shadows_.follow(rays, shape, blocked_.data(), count, shadow_, counts, visibility);
  }
  if (casts && scene.features & GLINT_FEATURE_MEDIA) dim_shadows(light, count);
}

bool LitBatch::is_dimmed(size_t k) const {
  bool dimmed = !shadow_[0] && blocked_[k];
  for (size_t c = 0; shadow_[0] && c < 3; ++c)
    dimmed |= (rays.diffuse[c][k] != 0 || (rays.specular[0] && rays.specular[c][k] != 0)) &&
              shadow_[c][k] != 1;
  return dimmed;
}

Vec3d LitBatch::start_towards(uint32_t point, const Vec3d& l) const {
  const Vec3d origin = row(points.origin, point), x = row(points.x, point);
  const double grazing = points.grazing ? points.grazing[point] : kGrazing,
               over_n = grazing * dot(row(points.n, point), l),
               over_g = grazing * dot(row(points.g, point), l),
               share = over_n < 1 ? 2 - (over_g + over_n) : 1 - over_g;
  return grazing > 0 ? x + std::clamp(share, 0.0, 1.0) * (origin - x) : x;
}

Vec3d LitBatch::shadow_start(uint32_t point, const Vec3d& origin, const Vec3d& end) const {
  const Vec3d g = row(points.g, point);
  const double offset = points.offset[point];
  double beside = offset;
  if (dot(g, end - origin) < 0)
    beside = dot(origin - row(points.x, point), g) > 0x1p-25 * offset ? 0 : -offset;
  return origin + beside * g - (beside < 0 ? 0 : offset) * row(points.d, point);
}

/// Multiplies what a sample gives to `count` points by what the light's program says of it there.
void LitBatch::apply_program(const Light& light, size_t count) {
  for (size_t first = 0; first < count; first += kBlock) {
    const size_t here = std::min(kBlock, count - first);
    for (size_t i = 0; i < (here + kPad - 1) / kPad * kPad; ++i) {
      const size_t k = first + std::min(i, here - 1);
      const Vec3d from = row(points.x, point_[k]), end = row(rays.end, k);
      program_.put(light, i, from, light.endless() ? row(rays.to, k) : unit(end - from), end);
    }
    program_.run(light, RayKind::kShadow, here);
    for (size_t i = 0; i < here; ++i) {
      const Vec3d share = program_.share(light, i);
      set_row(rays.diffuse, first + i, share * row(rays.diffuse, first + i));
      if (rays.specular[0])
        set_row(rays.specular, first + i, share * row(rays.specular, first + i));
    }
  }
}

/// What media on the way take of the light of the stage's `count` points.
void LitBatch::dim_shadows(const Light& light, size_t count) {
  const Rays sent = shadow_rays(count);
  media_.find(sent, counts);
  if (media_.empty()) return;
  ends_of_shadows_.resize(count);
  for (size_t k = 0; k < count; ++k)  // what is dark already is not asked
    ends_of_shadows_[k] = any(row(shadow_, k)) ? rays.t_max[k] : 0;
  media_.march(sent, ends_of_shadows_.data(), sample_, RayKind::kShadow, counts,
               light.passed_sets != 0 || alone_);
  for (size_t k = 0; k < count; ++k)
    set_row(shadow_, k,
            media_.passed(k, 0, rays.t_max[k], light.passed_sets, alone_) * row(shadow_, k));
}

/// False where a point's shadow is not known.
bool LitBatch::read_shadow_cache(const uint8_t* known, size_t count) {
  bool all = true;
  for (size_t k = 0; k < count; ++k) {
    const uint8_t shadow = known[point_[k]];
    all &= shadow != 0;
    blocked_[k] = shadow == 2;
  }
  return all;
}

/// known: of the points, as FirstHitCache::shadows has it, or null.
void LitBatch::find_shadows(const Light& light, size_t count, uint8_t* known) {
  if (known && read_shadow_cache(known, count)) return;
  const Timer timer(counts.tracing);
  Rays sent = shadow_rays(count);
  sent.visibility = visibility;
  // Else it is asked for after what is solid is known.
  if (light.passed_sets || alone_) sent.opacity = opacity(light);
  scene.trees.accel().occluded(sent, blocked_.data(), scratch);
  counts.shadow += count;
  for (size_t k = 0; known && k < count; ++k) known[point_[k]] = uint8_t(1 + blocked_[k]);
}

void LitBatch::add_to_sums(const Batch& batch, size_t count) const {
  const SumColumns& sums = batch.sums;
  if (batch.has_groups()) add_to_groups(batch, count);
  if (!glassy_ && !sums.diffuse[0]) {
    LightSum sum{count, point_.data(), blocked_.data(), {}, {}};
    for (int c = 0; c < 3; ++c) {
      sum.given[c] = rays.diffuse[c];
      sum.total[c] = sums.total[c];
    }
    return stages.sum(sum);
  }
  LightParts parts{count, point_.data(), blocked_.data(), {}, {}, {}, sums};
  for (int c = 0; c < 3; ++c) {
    parts.shadow[c] = shadow_[c];
    parts.diffuse[c] = rays.diffuse[c];
    parts.specular[c] = rays.specular[c];
  }
  stages.sum_parts(parts);
  if (batch.splits()) split(batch, count);
}

/// The same after shadows, to the light's group.
void LitBatch::add_to_groups(const Batch& batch, size_t count) const {
  if (!groups && size_t(group) >= batch.group_count()) return;
  if (!groups && !shadow_[0] && !rays.specular[0]) {
    double* const* const to = batch.opened_group(size_t(group));
    LightSum sum{count, point_.data(), blocked_.data(), {}, {to[0], to[1], to[2]}};
    std::copy_n(rays.diffuse, 3, sum.given);
    return stages.sum(sum);
  }
  for (size_t k = 0; k < count; ++k) {
    const Vec3d S = open(k);
    Vec3d given = row(rays.diffuse, k);
    if (rays.specular[0]) given += row(rays.specular, k);
    batch.add_to_group(groups ? groups[k] : group, point_[k], S * given);
  }
}

/// The same after shadows, by the kind of surface.
void LitBatch::split(const Batch& batch, size_t count) const {
  double* const* const diffuse = scattering ? batch.lit_volume : batch.lit_diffuse;
  for (size_t k = 0; k < count; ++k) {
    const Vec3d S = open(k);
    for (size_t c = 0; c < 3; ++c) {
      diffuse[c][point_[k]] += S[int(c)] * rays.diffuse[c][k];
      batch.lit_specular[c][point_[k]] += S[int(c)] * rays.specular[c][k];
    }
  }
}

void LitBatch::push_gather_ray(Path path, Vec3d start, Vec3d o, Vec3d l, Queue& gathering) const {
  path.leave(start);
  path.widen(RenderPlan::kBouncedExponent);
  path.depth = uint8_t(std::min(int(path.depth) + 1, 255));
  gathering.push({o, l, 0, kInfinity, kDiffuse}, path);
  ++counts.gather;
}

}  // namespace glint
