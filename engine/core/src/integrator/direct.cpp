#include "integrator/direct.h"

#include <algorithm>

#include "integrator/first_hit_cache.h"
#include "integrator/photon_emission.h"
#include "math/math.h"

namespace glint {
namespace {

/// Paths that bring less than this of what a bounced ray meets ask for few samples of lights.
constexpr double kFaint = 1.0 / 16;

/// The mean over the light of an even sky of what stage_terminator.h has it times.
double mean_lowered(double lowering) {
  if (!(lowering > 1)) return 1;
  return 2 * (lowering * sine(kPi / 2 / lowering) - 1) / (lowering * lowering - 1);
}

}  // namespace

void EmitterHits::reserve(size_t rows) {
  distance.reserve(rows);
  group.resize(rows);
  for (auto* column : {&emitter, &placement}) column->resize(rows);
  for (auto* column : {&u, &v}) column->resize(rows);
}

DirectLight::DirectLight(const LightContext& context)
    : LightContext(context),
      lit(context),
      onward(lit),
      scattered(lit),
      lamps_(SharedLight::kLamps, lit),
      glow_(SharedLight::kMedia, lit) {}

void DirectLight::illuminate(Batch& batch, uint32_t sample, bool alone) {
  lit.begin(batch, sample, alone);
  some_few_ = find_few(batch);
  add_lights(batch, sample);
}

/// Does something with the points that take all samples of lights, then with those that take few.
template <class Body>
void DirectLight::each_share(Batch& batch, Body body) {
  if (!some_few_) return body();
  whole_.assign(batch.lit, batch.lit + batch.size());
  for (const bool few : {false, true}) {
    for (size_t k = 0; k < batch.size(); ++k) batch.lit[k] = few_[k] == few ? whole_[k] : 0;
    takes_few_ = few;
    body();
  }
  takes_few_ = false;
  std::copy(whole_.begin(), whole_.end(), batch.lit);
}

/// Which points take few samples of lights: strands, of which each sample of a pixel meets others,
/// and what is faint. Whether there are any.
bool DirectLight::find_few(const Batch& batch) {
  const Queue& queue = *batch.queue;
  const bool bounced = queue.visibility != kCamera && !queue.gathers(),
             strands = scene.instances.has_strands && !queue.gathers();
  if (!bounced && !strands && !queue.exits) return false;
  few_.resize(batch.size());
  bool found = false;
  for (size_t k = 0; k < batch.size(); ++k) {
    few_[k] = queue.exits || (bounced && max_abs(queue.weight(k)) < kFaint) ||
              (strands && batch.lit[k] && batch.is_on_strand(k));
    found |= few_[k] && batch.lit[k];
  }
  return found;
}

/// Where photons bring lamps' light that mirrors throw, lamps do not light these at what rays of
/// bounced light meet.
void DirectLight::add_lights(Batch& batch, uint32_t sample) {
  if (!plan.photon_map || !batch.queue->gathers())
    return add_lights(batch, sample, [](const Light&) { return true; });
  add_lights(batch, sample, [](const Light& light) { return !throws_photons(light); });
  lit.points.lobes.highlights = scene.materials.highlights(false);
  add_lights(batch, sample, throws_photons);
  lit.points.lobes.highlights = batch.highlights();
}

/// Of those that `takes` says. So lights that share shadow rays share them among themselves; of
/// lamps each point looks at all, whether it takes few or not.
template <class Takes>
void DirectLight::add_lights(Batch& batch, uint32_t sample, Takes takes) {
  bool shared_lamps = false, shared_glow = false;
  each_share(batch, [&] {
    size_t number = 0;
    for (const Light& light : scene.lights) {
      if (!takes(light)) continue;
      if (lit.is_alone() && light.is_tabled()) continue;  // catchers do not glow
      const uint32_t count = plan.samples_of(light) / parts_of(batch, light);
      const bool of_lamps = lamps_.takes_part(light), of_glow = glow_.takes_part(light),
                 shares = of_lamps || of_glow,
                 notes = batch.soft_light && count > 1 && sample < Refinement::kFirst;
      const int64_t* const mask = !shares || notes ? lit.receivers(batch, light, linked_) : nullptr;
      if (notes) find_cut(batch, light, mask);
      if (!shares) add_light(batch, light, mask, sample, number);
      shared_lamps |= of_lamps;
      shared_glow |= of_glow;
      if (!of_glow) number += count;
      if (!shares) number += plan.opening_samples_of(light) / parts_of(batch, light);
    }
  });
  if (shared_lamps && !cancel) lamps_.add(batch, sample, false);
  if (shared_glow && !cancel) each_share(batch, [&] { glow_.add(batch, sample, takes_few_); });
}

/// In how many parts a light's samples are taken; what rays of bounced light meet takes one, of
/// many.
uint32_t DirectLight::parts_of(const Batch& batch, const Light& light) const {
  return batch.queue->gathers() ? plan.samples_of(light)
                                : plan.parts_of(light, batch.queue->sees_blurred(), takes_few_);
}

/// mask: of the points that it may reach.  number: of its first sample, of all lights'.
void DirectLight::add_light(const Batch& batch, const Light& light, const int64_t* mask,
                            uint32_t sample, size_t number) {
  const bool one = batch.queue->gathers();
  const uint32_t parts = parts_of(batch, light), count = plan.samples_of(light) / parts,
                 openings = plan.opening_samples_of(light) / parts, first = sample % parts * count,
                 first_opening = plan.samples_of(light) + sample % parts * openings;
  if (light.is_dome()) balance_.assign(batch.size(), 0);
  lit.ask_ends(light.program);
  LampSample lamp{{}, lit.policy_of(light), mask, false};
  lamp.policy.power_heuristic |= light.is_dome() && scene.instances.diffuse_differs;
  lamp.policy.draws &= !one;                             // all lobes are wide there
  lamp.policy.casts_shadow |= light.program != nullptr;  // so that the ends are known
  for (uint32_t j = 0; j < count + openings && !cancel; ++j, ++number) {
    const uint32_t own = j < count ? first + j : first_opening + (j - count);
    const LightPoint point = plan.set_sample(lamp, light, sample, own, parts);
    if (parts > 1) lamp.light.count = count;
    if (light.is_dome() && j == 0 && plan.interleaving > 1) {
      // where the reflected ray goes, whose light is resolved with this: one of the two meets
      // something, and their sum has less noise than each
      const double* const place = plan.lobe_point(sample, batch.queue->past.reflections);
      lamp.light.draws.place = disc_place(place[0], place[1]);
    }
    lit.group = point.group;
    lit.visibility = point.met_by;
    // What is known of shadows is not told when instances change their sets.
    uint8_t* const known =
        batch.first_hits && light.passed_sets == 0 && !lit.is_alone() && !takes_few_
            ? batch.first_hits->shadows(number)
            : nullptr;
    const size_t reached = stages.light(lit.points, lamp, lit.rays);
    lit.add(batch, light, lamp.light, reached, known ? known + batch.first_row : nullptr);
    if (light.is_dome() && j < count) note_hidden(reached, parts);
    if (parts > 1 && light.is_mesh() ? j == 0 : point.draws) add_drawn(batch, light, lamp);
    lit.visibility = kShadow;
  }
  // where pixels are averaged their few directions would say too seldom what is hidden
  if (light.is_dome() && light.lights_matt() && plan.interleaving == 1 && !one)
    add_rest(batch, light, mask, sample, parts);
}

/// In directions that lobes draw.
void DirectLight::add_drawn(const Batch& batch, const Light& light, const LampSample& lamp) {
  if (light.is_mesh()) emitters_.reserve(lit.rows());
  if (light.is_mesh()) lit.groups = emitters_.group.data();
  if (lamp.policy.draws && lamp.light.draws.on) {
    size_t drawn = stages.gloss(lit.points, lamp, lit.rays);
    lit.visibility = kMirror;
    if (light.is_mesh()) drawn = find_emitters(light, lamp, drawn, false);
    lit.add(batch, light, lamp.light, drawn, nullptr);
  }
  if (lamp.policy.draws_diffuse) {
    const size_t drawn = onward.draw_diffuse(batch, lamp);
    lit.visibility = kDiffuse;
    lit.add(batch, light, lamp.light, find_emitters(light, lamp, drawn, true), nullptr);
  }
  lit.groups = nullptr;
}

/// Counts for the `count` points that a sample reaches whether something hides it from them, or
/// dims it for them.
void DirectLight::note_hidden(size_t count, uint32_t parts) {
  const int32_t hidden = parts > 1 ? 1 << 16 : 1;  // of few directions one tells enough
  for (size_t k = 0; k < count; ++k) balance_[lit.rays.point[k]] += lit.is_dimmed(k) ? -hidden : 1;
}

/// What the directions of a sample leave out of a dome, where at least half of them are open (all,
/// where they are taken in parts): so what stands free has no steps, and its pixels may stop soon.
void DirectLight::add_rest(const Batch& batch, const Light& light, const int64_t* mask,
                           uint32_t sample, uint32_t parts) {
  sky_.reserve(batch.size());
  double* const sky[3] = {sky_[0], sky_[1], sky_[2]};
  const uint32_t directions = plan.dome_directions.each / parts, part = sample % parts;
  std::vector<OpeningPoint> points(plan.opening_samples_of(light) / parts);
  for (size_t j = 0; j < points.size(); ++j)
    points[j] = plan.opening_point(sample, uint32_t(part * points.size() + j));
  stages.dome({&lit.points,
               mask,
               plan.light_point(light, sample, part * directions).drawn,
               directions,
               &plan.open,
               points.data(),
               points.size(),
               &plan.dome,
               {sky[0], sky[1], sky[2]}});
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!mask[k] || balance_[k] < 0) continue;
    Vec3d rest = row(sky, k);
    if (batch.lowering) rest = mean_lowered(batch.lowering[k]) * rest;
    batch.add_to_group(light.group, k, rest);
    Batch::add_to(batch.sums.total, k, rest);
    Batch::add_to(batch.sums.diffuse, k, rest);
    if (batch.splits()) Batch::add_to(batch.lit_diffuse, k, rest);
  }
}

/// What `count` drawn directions hit of a mesh light: samples of it, as the stage has them of other
/// lights. How many do.
size_t DirectLight::find_emitters(const Light& light, const LampSample& lamp, size_t count,
                                  bool matt) {
  const double samples = lamp.light.count;
  const ShadowRays& rays = lit.rays;
  EmitterHits& hits = emitters_;
  double* const distance = hits.distance[0];
  scene.trees.emitters(light).closest(
      lit.shadow_rays(count),
      {distance, hits.placement.data(), hits.emitter.data(), hits.u.data(), hits.v.data()},
      scratch);
  size_t kept = 0;
  for (size_t k = 0; k < count; ++k) {
    if (hits.placement[k] == Hit::kNone) continue;
    const GlintEmitter& emitter = scene.lights.emitters[light.first_emitter + hits.emitter[k]];
    const Vec3d from = row(rays.o, k), l = row(rays.to, k), q = from + distance[k] * l;
    const Vec3d origin = lit.start_towards(rays.point[k], l);
    const EmitterHit hit = light.emitter_hit(emitter, row(lit.points.x, rays.point[k]), origin, q,
                                             l, uint32_t(samples));
    const double times = rays.pdf[k] * (matt ? hit.whole / samples : hit.inverse_pdf),
                 factor = matt ? hit.whole / (kPi * samples) / (times + 1 / times)
                          : lamp.policy.power_heuristic ? samples * hit.factor / (times + 1 / times)
                                                        : hit.factor / (1 + times / samples);
    const Vec3d given = factor * hit.color * row(rays.diffuse, k);
    if (!any(given) || (!hit.front && dot(row(lit.points.g, rays.point[k]), l) <= 0)) continue;
    const Vec3d start = lit.shadow_start(rays.point[k], origin, hit.end), to = hit.end - start;
    rays.point[kept] = rays.point[k];
    hits.group[kept] = emitter.light_group - 1;
    set_row(rays.o, kept, start);
    set_row(rays.to, kept, unit(to));
    rays.t_max[kept] = length(to) - rounding(std::max(max_abs(hit.end), max_abs(start)));
    if (rays.start[0]) set_row(rays.start, kept, origin);
    if (rays.end[0]) set_row(rays.end, kept, hit.end);
    const bool apart = rays.specular[0] && !matt;
    set_row(rays.diffuse, kept, apart ? Vec3d{} : given);
    if (rays.specular[0]) set_row(rays.specular, kept, apart ? given : Vec3d{});
    ++kept;
  }
  std::fill_n(rays.t_max + kept, count - kept, kInfinity);
  return kept;
}

/// Notes the points whose horizon cuts the light.
void DirectLight::find_cut(const Batch& batch, const Light& light, const int64_t* mask) const {
  for (size_t k = 0; k < batch.size(); ++k)
    if (mask[k] && light.is_cut(row(batch.x, k), row(batch.n, k)))
      batch.mark_soft_light(k, Refinement::kCut);
}

}  // namespace glint
