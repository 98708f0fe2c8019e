#include "integrator/direct.h"

#include <algorithm>

#include "integrator/first_hit_cache.h"
#include "integrator/photon_emission.h"
#include "math/math.h"
#include "scene/surface.h"
#include "system/timer.h"

namespace glint {
namespace {

constexpr size_t kColumns =
    1 + 3 + 3 + 1 + 3 + 3 + 3 + 3 + 3 + 3 +
    2;  // zeros, o, to, t_max, starts, ends, diffuse, specular, shadow, sky, density and distance

/// Paths that bring less than this of what a bounced ray meets ask for few samples of lights.
constexpr double kFaint = 1.0 / 16;

/// The mean over the light of an even sky of what stage_terminator.h has it times.
double mean_lowered(double lowering) {
  if (!(lowering > 1)) return 1;
  return 2 * (lowering * sine(kPi / 2 / lowering) - 1) / (lowering * lowering - 1);
}

}  // namespace

DirectLight::DirectLight(const Scene& scene, const RenderPlan& plan, const Stages& stages,
                         const std::atomic<bool>& cancel, Scratch& scratch)
    : scene_(scene),
      plan_(plan),
      stages_(stages),
      cancel_(cancel),
      scratch_(scratch),
      glassy_(scene.features & GLINT_FEATURE_TRANSPARENT),
      columns_(kColumns),
      program_(scene, stages),
      transparent_shadows_(scene, stages, cancel, scratch),
      media_(scene, scratch),
      scattered_(6) {
  find_sharing();
}

void DirectLight::prepare(const Batch& batch) {
  columns_.reserve(batch.size());
  point_.resize(columns_.rows());
  blocked_.resize(columns_.rows());
  size_t next = 0;
  auto three = [&](double*(&to)[3], bool wanted) {
    for (double*& column : to) column = wanted ? columns_[next++] : nullptr;
  };
  zeros_ = columns_[next++];
  rays_.t_max = columns_[next++];
  for (size_t c = 0; c < 2; ++c) disc_[c].resize(columns_.rows());
  rays_.point = point_.data();
  three(rays_.o, true);
  three(rays_.to, true);
  three(rays_.diffuse, true);
  three(rays_.specular, batch.sums.diffuse[0]);
  three(ends_, true);
  three(shadow_, glassy_);
  three(rays_.start, glassy_ && batch.points.origin[0] != batch.points.x[0]);
  three(sky_, scene_.features & GLINT_FEATURE_WORLD_LIGHT);
  if (scene_.features & GLINT_FEATURE_MESH_LIGHT) {
    rays_.pdf = columns_[next++];
    distance_ = columns_[next++];
    for (auto* column : {&emitter_, &placement_}) column->resize(columns_.rows());
    met_group_.resize(columns_.rows());
    for (auto* column : {&u_, &v_}) column->resize(columns_.rows());
  }
  const PointColumns& p = batch.points;
  for (int c = 0; c < 3; ++c) {
    points_.x[c] = p.x[c];
    points_.g[c] = p.g[c];
    points_.n[c] = p.n[c];
    points_.origin[c] = rays_.origin[c] = p.origin[c];
    points_.d[c] = batch.queue->rays().d[c];
    points_.diffuse[c] = batch.diffuse[c];
    points_.unbent[c] = batch.unbent[c];
  }
  points_.bump = batch.bump;
  points_.grazing = batch.grazing;
  points_.lowering = batch.lowering;
  points_.count = batch.size();
  points_.offset = p.offset;
  points_.lobes.columns = batch.specular;
  points_.lobes.stride = batch.stride;
  points_.lobes.layout = &scene_.materials.rows_of_lobes;
  points_.lobes.highlights = batch.highlights();
  points_.lobes.shown = plan_.reflections == GLINT_REFLECT_ALL;
  points_.lobes.shows_nothing = batch.queue->gathers();
  points_.lobes.others = scene_.materials.spans.data();
  points_.lobes.other_count = scene_.materials.other_count();
  points_.lobes.has_fibre = scene_.materials.has_fibre;
  points_.lobes.turns = scene_.materials.turns_lobes;
  points_.lobes.stretches = scene_.materials.stretches_lobes;
  points_.lobes.edges = scene_.materials.edges_lobes;
}

LightPolicy DirectLight::policy_of(const Light& light) const {
  LightPolicy policy = light.policy();
  policy.draws_diffuse &= !scene_.materials.has_fibre;
  policy.power_heuristic = scene_.instances.mirrors_differ;
  policy.most_exponent = scene_.materials.most_exponent;
  return policy;
}

OnwardStage DirectLight::onward(const int64_t* lit) const {
  return {&points_, lit, {disc_[0].data(), disc_[1].data()}, rays_, false, false, nullptr};
}

void DirectLight::illuminate(Batch& batch, uint32_t sample, bool alone, RayCounts& counts) {
  sample_ = sample;
  alone_ = alone;
  prepare(batch);
  if (!find_few(batch)) return add_lights(batch, sample, counts);
  whole_.assign(batch.lit.begin(), batch.lit.end());
  for (const bool few : {false, true}) {
    for (size_t k = 0; k < batch.size(); ++k) batch.lit[k] = few_[k] == few ? whole_[k] : 0;
    takes_few_ = few;
    add_lights(batch, sample, counts);
  }
  takes_few_ = false;
  std::copy(whole_.begin(), whole_.end(), batch.lit.begin());
}

/// Which points take few samples of lights: strands, of which each sample of a pixel meets others,
/// and what is faint. Whether there are any.
bool DirectLight::find_few(const Batch& batch) {
  const Queue& queue = *batch.queue;
  const bool bounced = queue.visibility != kCamera && !queue.gathers(),
             strands = scene_.instances.has_strands && !queue.gathers();
  if (!bounced && !strands && !queue.exits) return false;
  few_.resize(batch.size());
  bool found = false;
  for (size_t k = 0; k < batch.size(); ++k) {
    few_[k] = queue.exits || (bounced && max_abs(queue.weight(k)) < kFaint) ||
              (strands && batch.lit[k] && is_on_strand(batch, k));
    found |= few_[k] && batch.lit[k];
  }
  return found;
}

/// Where photons bring lamps' light that mirrors throw, lamps do not light these at what rays of
/// bounced light meet.
void DirectLight::add_lights(Batch& batch, uint32_t sample, RayCounts& counts) {
  if (!plan_.photon_map || !batch.queue->gathers())
    return add_lights(batch, sample, counts, [](const Light&) { return true; });
  add_lights(batch, sample, counts, [](const Light& light) { return !throws_photons(light); });
  points_.lobes.highlights = scene_.materials.highlights(false);
  add_lights(batch, sample, counts, throws_photons);
  points_.lobes.highlights = batch.highlights();
}

/// Of those that `takes` says. So lights that share shadow rays share them among themselves.
template <class Takes>
void DirectLight::add_lights(Batch& batch, uint32_t sample, RayCounts& counts, Takes takes) {
  size_t number = 0;
  bool shared_lamps = false, shared_glow = false;
  for (const Light& light : scene_.lights) {
    if (!takes(light)) continue;
    const bool one = batch.queue->gathers();  // each is of many
    const uint32_t parts = one ? plan_.samples_of(light)
                               : plan_.parts_of(light, batch.queue->sees_blurred(), takes_few_),
                   count = plan_.samples_of(light) / parts;
    if (alone_ && (light.is_mesh() || light.is_medium())) continue;  // catchers do not glow
    const bool asks_few = light.is_medium(),
               shares = asks_few || (lamps_.on && lamps_.takes_part[light.number]),
               notes = batch.soft_light && count > 1 && sample < Refinement::kFirst;
    const int64_t* const lit = !shares || notes ? find_lit(batch, light) : nullptr;
    if (notes) find_cut(batch, light, lit);
    if (shares) {
      (asks_few ? shared_glow : shared_lamps) = true;
      if (!asks_few) number += count;
      continue;
    }
    if (light.is_dome()) balance_.assign(batch.size(), 0);
    for (int c = 0; c < 3; ++c) rays_.end[c] = glassy_ || light.program ? ends_[c] : nullptr;
    LampSample lamp{{}, policy_of(light), lit, false};
    lamp.policy.power_heuristic |= light.is_dome() && scene_.instances.diffuse_differs;
    lamp.policy.draws &= !one;                             // all lobes are wide there
    lamp.policy.casts_shadow |= light.program != nullptr;  // so that the ends are known
    const uint32_t openings = plan_.opening_samples_of(light) / parts,
                   first = sample % parts * count,
                   first_opening = plan_.samples_of(light) + sample % parts * openings;
    for (uint32_t j = 0; j < count + openings && !cancel_; ++j, ++number) {
      const uint32_t own = j < count ? first + j : first_opening + (j - count);
      LightPoint point = plan_.set_sample(lamp, light, sample, own);
      if (parts > 1) lamp.light.count = count;
      if (parts > 1 && light.is_mesh()) point.draws = j == 0;
      group_ = point.group;
      // What is known of shadows is not told when instances change their sets.
      uint8_t* const known = batch.first_hits && light.passed_sets == 0 && !alone_ && !takes_few_
                                 ? batch.first_hits->shadows(number)
                                 : nullptr;
      const size_t reached = stages_.light(points_, lamp, rays_);
      met_by_ = point.met_by;
      add_lit(batch, light, lamp.light, reached, known ? known + batch.first_row : nullptr, counts);
      if (light.is_dome() && j < count) note_hidden(reached, parts);
      if (lamp.policy.draws && lamp.light.draws.on && point.draws) {
        const size_t drawn = stages_.gloss(points_, lamp, rays_);
        met_ = light.is_mesh();
        met_by_ = kMirror;
        add_lit(batch, light, lamp.light, met_ ? meet_emitters(light, lamp, drawn, false) : drawn,
                nullptr, counts);
        met_ = false;
      }
      if (lamp.policy.draws_diffuse && point.draws) {
        met_by_ = kDiffuse;
        met_ = true;
        const size_t drawn = draw_diffuse(batch, lamp);
        add_lit(batch, light, lamp.light, meet_emitters(light, lamp, drawn, true), nullptr, counts);
        met_ = false;
      }
      met_by_ = kShadow;
    }
    // where pixels are averaged their few directions would say too seldom what is hidden
    if (light.is_dome() && light.lights_matt() && plan_.interleaving == 1 && !one)
      add_rest(batch, light, lit, sample, parts);
  }
  if (lamps_.on && shared_lamps && !cancel_) share(lamps_, batch, sample, counts);
  if (glow_.on && shared_glow && !cancel_) share(glow_, batch, sample, counts);
}

/// The mask of points that the light may reach.
const int64_t* DirectLight::find_lit(const Batch& batch, const Light& light) {
  if (light.lights_all()) return batch.lit.data();
  linked_.assign(batch.lit.begin(), batch.lit.end());
  for (size_t k = 0; k < batch.size(); ++k)
    if (linked_[k] && !light.lights(scene_.instances.group(batch.instance[k]).light_set))
      linked_[k] = 0;
  return linked_.data();
}

/// Counts for the `count` points of the stage whether something hides the sample from them, or
/// dims it for them. Where shadows have colours, `blocked_` may be that of an earlier sample.
void DirectLight::note_hidden(size_t count, uint32_t parts) {
  const int32_t hidden = parts > 1 ? 1 << 16 : 1;  // of few directions one tells enough
  for (size_t k = 0; k < count; ++k) {
    bool dimmed = !shadow_[0] && blocked_[k];
    for (size_t c = 0; shadow_[0] && c < 3; ++c)
      dimmed |= (rays_.diffuse[c][k] != 0 || (rays_.specular[0] && rays_.specular[c][k] != 0)) &&
                shadow_[c][k] != 1;
    balance_[point_[k]] += dimmed ? -hidden : 1;
  }
}

/// What the directions of a sample leave out of a dome, where at least half of them are open (all,
/// where they are taken in parts): so what stands free has no steps, and its pixels may stop soon.
void DirectLight::add_rest(const Batch& batch, const Light& light, const int64_t* lit,
                           uint32_t sample, uint32_t parts) {
  DomeStage stage{};
  for (int c = 0; c < 3; ++c) {
    stage.n[c] = points_.n[c];
    stage.diffuse[c] = batch.diffuse[c];
    stage.rest[c] = sky_[c];
  }
  stage.count = batch.size();
  stage.lit = lit;
  stage.dome = &plan_.dome;
  const uint32_t directions = plan_.dome_directions.each / parts, part = sample % parts;
  stage.drawn = plan_.light_point(light, sample, part * directions).drawn;
  stage.directions = directions;
  std::vector<OpeningPoint> points(plan_.opening_samples_of(light) / parts);
  for (size_t j = 0; j < points.size(); ++j)
    points[j] = plan_.opening_point(sample, uint32_t(part * points.size() + j));
  for (int c = 0; c < 3; ++c) stage.x[c] = points_.x[c];
  stage.openings = &plan_.open;
  stage.opening_points = points.data();
  stage.opening_point_count = points.size();
  stages_.dome(stage);
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!lit[k] || balance_[k] < 0) continue;
    if (batch.lowering) set_row(sky_, k, mean_lowered(batch.lowering[k]) * row(sky_, k));
    if (batch.has_groups()) batch.add_to_group(light.group, k, row(sky_, k));
    for (size_t c = 0; c < 3; ++c) {
      batch.sums.total[c][k] += sky_[c][k];
      if (batch.sums.diffuse[0]) batch.sums.diffuse[c][k] += sky_[c][k];
      if (batch.splits()) batch.lit_diffuse[c][k] += sky_[c][k];
    }
  }
}

/// Adds the light of a sample to the `count` points that it reaches.
void DirectLight::add_lit(const Batch& batch, const Light& light, const LightSample& from,
                          size_t count, uint8_t* known, RayCounts& counts) {
  if (count == 0) return;
  if (light.program) apply_program(light, count);
  const bool soft = batch.soft_light && from.count > 1 && !light.is_dome();
  for (size_t k = 0; soft && k < count; ++k) batch.mark_soft_light(point_[k], Refinement::kReached);
  const bool casts = light.casts_shadow();
  for (size_t k = 0; casts && batch.cost && k < count; ++k) batch.charge(point_[k]);
  if (casts && glassy_ && !known) {
    transparent_shadows_.trace(rays_, from.shape, opacity(light), zeros_, count, shadow_, counts,
                               met_by_);
  } else {
    if (casts) find_shadows(light, count, known, counts);
    else std::fill_n(blocked_.begin(), count, uint8_t(0));
    if (glassy_)
      transparent_shadows_.follow(rays_, from.shape, blocked_.data(), count, shadow_, counts,
                                  met_by_);
  }
  if (casts && scene_.features & GLINT_FEATURE_MEDIA) dim_shadows(light, count, counts);
  add(batch, count);
}

/// Where the shadow ray along l of a point of the batch leaves the surface, as the stage has it.
Vec3d DirectLight::start_towards(uint32_t point, const Vec3d& l) const {
  const Vec3d origin = row(points_.origin, point), x = row(points_.x, point);
  const double grazing = points_.grazing ? points_.grazing[point] : kGrazing,
               over_n = grazing * dot(row(points_.n, point), l),
               over_g = grazing * dot(row(points_.g, point), l),
               share = over_n < 1 ? 2 - (over_g + over_n) : 1 - over_g;
  return grazing > 0 ? x + std::clamp(share, 0.0, 1.0) * (origin - x) : x;
}

/// Where the shadow ray of a point of the batch starts that leaves the surface at `origin` and ends
/// at `end`, as the stage has it.
Vec3d DirectLight::shadow_start(uint32_t point, const Vec3d& origin, const Vec3d& end) const {
  const Vec3d g = row(points_.g, point);
  const double offset = points_.offset[point];
  double beside = offset;
  if (dot(g, end - origin) < 0)
    beside = dot(origin - row(points_.x, point), g) > 0x1p-25 * offset ? 0 : -offset;
  return origin + beside * g - (beside < 0 ? 0 : offset) * row(points_.d, point);
}

/// What the `count` drawn directions of the stage meet of a mesh light: samples of it, as the stage
/// has them of other lights. How many do.
size_t DirectLight::meet_emitters(const Light& light, const LampSample& lamp, size_t count,
                                  bool matt) {
  const double samples = lamp.light.count;
  const Rays rays = shadow_rays(count);
  scene_.trees.emitters(light).closest(
      rays, {distance_, placement_.data(), emitter_.data(), u_.data(), v_.data()}, scratch_);
  size_t kept = 0;
  for (size_t k = 0; k < count; ++k) {
    if (placement_[k] == Hit::kNone) continue;
    const GlintEmitter& emitter = scene_.lights.emitters[light.first_emitter + emitter_[k]];
    const Vec3d from = row(rays_.o, k), l = row(rays_.to, k), q = from + distance_[k] * l;
    const Vec3d origin = start_towards(point_[k], l);
    const LightMeeting met =
        light.meeting(emitter, row(points_.x, point_[k]), origin, q, l, uint32_t(samples));
    const double times = rays_.pdf[k] * (matt ? met.whole / samples : met.spread),
                 factor = matt ? met.whole / (kPi * samples) / (times + 1 / times)
                          : lamp.policy.power_heuristic ? samples * met.factor / (times + 1 / times)
                                                        : met.factor / (1 + times / samples);
    const Vec3d given = factor * met.color * row(rays_.diffuse, k);
    if (!any(given) || (!met.front && dot(row(points_.g, point_[k]), l) <= 0)) continue;
    const Vec3d start = shadow_start(point_[k], origin, met.end), to = met.end - start;
    point_[kept] = point_[k];
    met_group_[kept] = emitter.light_group - 1;
    set_row(rays_.o, kept, start);
    set_row(rays_.to, kept, unit(to));
    rays_.t_max[kept] = length(to) - rounding(std::max(max_abs(met.end), max_abs(start)));
    if (rays_.start[0]) set_row(rays_.start, kept, origin);
    if (rays_.end[0]) set_row(rays_.end, kept, met.end);
    const bool apart = rays_.specular[0] && !matt;
    set_row(rays_.diffuse, kept, apart ? Vec3d{} : given);
    if (rays_.specular[0]) set_row(rays_.specular, kept, apart ? given : Vec3d{});
    ++kept;
  }
  std::fill_n(rays_.t_max + kept, count - kept, kInfinity);
  return kept;
}

/// Directions that what is matt draws to a lamp's points, with the cosine's pdf: how many.
size_t DirectLight::draw_diffuse(const Batch& batch, const LampSample& lamp) {
  const DiscPlace& place = lamp.light.draws.place;
  const double r = std::sqrt(place.radius2);
  for (size_t c = 0; c < 2; ++c) std::fill_n(disc_[c].begin(), batch.size(), r * place.azimuth[c]);
  const size_t drawn = stages_.gather(onward(lamp.lit));
  std::fill_n(rays_.t_max, drawn, kInfinity);
  for (size_t k = 0; k < drawn; ++k) {
    const double cosine = dot(row(points_.n, point_[k]), row(rays_.to, k));
    rays_.pdf[k] = cosine / kPi;
    set_row(rays_.diffuse, k, cosine * row(rays_.diffuse, k));
  }
  return drawn;
}

/// Multiplies what a sample gives to `count` points by what the light's program says of it there.
void DirectLight::apply_program(const Light& light, size_t count) {
  for (size_t first = 0; first < count; first += kBlock) {
    const size_t here = std::min(kBlock, count - first);
    for (size_t i = 0; i < (here + kPad - 1) / kPad * kPad; ++i) {
      const size_t k = first + std::min(i, here - 1);
      const Vec3d from = row(points_.x, point_[k]), end = row(rays_.end, k);
      program_.put(light, i, from, light.endless() ? row(rays_.to, k) : unit(end - from), end);
    }
    program_.run(light, RayKind::kShadow, here);
    for (size_t i = 0; i < here; ++i) {
      const Vec3d share = program_.share(light, i);
      set_row(rays_.diffuse, first + i, share * row(rays_.diffuse, first + i));
      if (rays_.specular[0])
        set_row(rays_.specular, first + i, share * row(rays_.specular, first + i));
    }
  }
}

/// What media on the way take of the light of the stage's `count` points.
void DirectLight::dim_shadows(const Light& light, size_t count, RayCounts& counts) {
  const Rays rays = shadow_rays(count);
  media_.find(rays, counts);
  if (media_.empty()) return;
  ends_of_shadows_.resize(count);
  for (size_t k = 0; k < count; ++k)  // what is dark already is not asked
    ends_of_shadows_[k] = any(row(shadow_, k)) ? rays_.t_max[k] : 0;
  media_.march(rays, ends_of_shadows_.data(), sample_, RayKind::kShadow, counts,
               light.passed_sets != 0 || alone_);
  for (size_t k = 0; k < count; ++k)
    set_row(shadow_, k,
            media_.passed(k, 0, rays_.t_max[k], light.passed_sets, alone_) * row(shadow_, k));
}

/// Notes the points whose horizon cuts the light.
void DirectLight::find_cut(const Batch& batch, const Light& light, const int64_t* lit) const {
  for (size_t k = 0; k < batch.size(); ++k)
    if (lit[k] && light.is_cut(row(batch.points.x, k), row(batch.points.n, k)))
      batch.mark_soft_light(k, Refinement::kCut);
}

/// False where a point's shadow is not known.
bool DirectLight::read_shadow_cache(const uint8_t* known, size_t count) {
  bool all = true;
  for (size_t k = 0; k < count; ++k) {
    const uint8_t shadow = known[point_[k]];
    all &= shadow != 0;
    blocked_[k] = shadow == 2;
  }
  return all;
}

/// known: of the points, as FirstHitCache::shadows has it, or null.
void DirectLight::find_shadows(const Light& light, size_t count, uint8_t* known,
                               RayCounts& counts) {
  if (known && read_shadow_cache(known, count)) return;
  const Timer timer(counts.tracing);
  Rays rays = shadow_rays(count);
  rays.visibility = met_by_;
  // Else it is asked for after what is solid is known.
  if (light.passed_sets || alone_) rays.opacity = opacity(light);
  scene_.trees.accel().occluded(rays, blocked_.data(), scratch_);
  counts.shadow += count;
  for (size_t k = 0; known && k < count; ++k) known[point_[k]] = uint8_t(1 + blocked_[k]);
}

void DirectLight::add(const Batch& batch, size_t count) const {
  const SumColumns& sums = batch.sums;
  if (batch.has_groups()) add_to_groups(batch, count);
  if (!glassy_ && !sums.diffuse[0]) {
    LightSum sum{count, point_.data(), blocked_.data(), {}, {}};
    for (int c = 0; c < 3; ++c) {
      sum.given[c] = rays_.diffuse[c];
      sum.total[c] = sums.total[c];
    }
    return stages_.sum(sum);
  }
  LightParts parts{count, point_.data(), blocked_.data(), {}, {}, {}, sums};
  for (int c = 0; c < 3; ++c) {
    parts.shadow[c] = shadow_[c];
    parts.diffuse[c] = rays_.diffuse[c];
    parts.specular[c] = rays_.specular[c];
  }
  stages_.sum_parts(parts);
  if (batch.splits()) split(batch, count);
}

/// The same after shadows, to the light's group.
void DirectLight::add_to_groups(const Batch& batch, size_t count) const {
  if (!met_ && size_t(group_) >= batch.group_count()) return;
  if (!met_ && !shadow_[0] && !rays_.specular[0]) {
    double* const* const to = batch.opened_group(size_t(group_));
    LightSum sum{count, point_.data(), blocked_.data(), {}, {to[0], to[1], to[2]}};
    std::copy_n(rays_.diffuse, 3, sum.given);
    return stages_.sum(sum);
  }
  for (size_t k = 0; k < count; ++k) {
    const Vec3d S = shadow_[0] ? row(shadow_, k) : blocked_[k] ? Vec3d{} : Vec3d{1, 1, 1};
    Vec3d given = row(rays_.diffuse, k);
    if (rays_.specular[0]) given += row(rays_.specular, k);
    batch.add_to_group(met_ ? met_group_[k] : group_, point_[k], S * given);
  }
}

/// The same after shadows, by the kind of surface.
void DirectLight::split(const Batch& batch, size_t count) const {
  double* const* const diffuse = scattering_ ? batch.lit_volume : batch.lit_diffuse;
  for (size_t k = 0; k < count; ++k) {
    const Vec3d S = shadow_[0] ? row(shadow_, k) : blocked_[k] ? Vec3d{} : Vec3d{1, 1, 1};
    for (size_t c = 0; c < 3; ++c) {
      diffuse[c][point_[k]] += S[int(c)] * rays_.diffuse[c][k];
      batch.lit_specular[c][point_[k]] += S[int(c)] * rays_.specular[c][k];
    }
  }
}

}  // namespace glint
