// Many lamps (SEMANTICS.md): all of them light a point, and some are asked for their shadows, which
// stand for those of all.
#include <algorithm>

#include "integrator/direct.h"
#include "math/math.h"
#include "scene/surface.h"
#include "system/timer.h"

namespace glint {
namespace {

constexpr uint64_t kMostRays = 4096;  // that lamps share at a point in a pixel's sample

/// Where the first of a sample's marks is: of n samples each in another of n places between two
/// marks (van der Corput's sequence), none where sums of alike lamps end.
double mark_offset(uint32_t sample) {
  uint32_t reversed = 0;
  for (int bit = 0; bit < 32; ++bit) reversed |= (sample >> bit & 1u) << (31 - bit);
  const double offset = double(reversed) * 0x1p-32 + 0.3819660112501051;
  return offset < 1 ? offset : offset - 1;
}

/// How much more a lamp gives than the middle of its cluster does, for colours alike. given: by the
/// sample to a white point.
double beside_middle(const Light& light, const AskedLamp& chosen, const Vec3d& given) {
  const Vec3d& color = light.color;
  return (given.x + given.y + given.z) / ((color.x + color.y + color.z) * chosen.middle);
}

/// Room for what the groups of lights give, and what of those asked gets through.
void place_groups(SharedLight& shared, size_t points) {
  const size_t each = 3 * shared.group_count;
  if (each == 0) return;
  if (shared.group_given.empty()) shared.group_columns = Columns(3 * each);
  shared.group_columns.reserve(points);
  size_t next = 0;
  for (auto* sums : {&shared.group_given, &shared.group_asked, &shared.group_passed}) {
    sums->resize(each);
    for (double*& column : *sums) {
      column = shared.group_columns[next++];
      std::fill_n(column, shared.group_columns.rows(), 0.0);
    }
  }
}

void place_sums(SharedLight& shared, size_t points) {
  Columns& columns = shared.columns;
  columns.reserve(points);
  size_t next = 0;
  for (auto* sum : {&shared.diffuse, &shared.specular, &shared.asked, &shared.passed})
    for (double*& column : *sum) column = columns[next++];
  shared.total = columns[next++];
  shared.ones = columns[next++];
  for (double*& column : shared.gloss) column = columns[next++];
  std::fill_n(shared.ones, columns.rows(), 1.0);
  for (size_t c = 0; c < 3; ++c) {
    std::fill_n(shared.asked[c], points, 0.0);
    std::fill_n(shared.passed[c], points, 0.0);
  }
  shared.asks.assign(columns.rows(), 0);
  shared.place.resize(columns.rows());
  shared.chosen.resize(shared.rays * points);
}

/// The share of light that arrives where so much got through of what was asked for; `else_` where
/// nothing was.
Vec3d share_open(Vec3d asked, Vec3d passed, Vec3d else_) {
  const double all = asked.x + asked.y + asked.z;
  Vec3d open;
  for (int c = 0; c < 3; ++c) {
    const double mean = all > 0 ? (passed.x + passed.y + passed.z) / all : else_[c];
    open[c] = std::clamp(asked[c] > 0 ? passed[c] / asked[c] : mean, 0.0, 1.0);
  }
  return open;
}

void sort_chosen(SharedLight& shared, size_t count) {
  std::vector<uint32_t>& ends = shared.ends;
  ends.assign(shared.samples.size() + 1, 0);
  for (size_t k = 0; k < count; ++k) ++ends[shared.chosen[k].sample + 1];
  for (size_t number = 1; number < ends.size(); ++number) ends[number] += ends[number - 1];
  shared.sorted.resize(count);
  for (size_t k = 0; k < count; ++k)
    shared.sorted[ends[shared.chosen[k].sample]++] = shared.chosen[k];
}

/// The same for all batches: which samples there are does not depend on these. Each group of lights
/// has a tree of its own.
void find_clusters(SharedLight& shared) {
  std::vector<ClusteredLamp> lamps;
  const auto plant = [&] {
    const uint32_t first = uint32_t(shared.clusters.size());
    for (LampCluster cluster : clusters_of(lamps)) {
      cluster.next += first;
      shared.clusters.push_back(cluster);
    }
    lamps.clear();
  };
  Vec3d sum{};
  for (size_t k = 0; k < shared.samples.size(); ++k) {
    const LampSample& sample = shared.samples[k];
    const uint32_t number = uint32_t(k);
    const Light* const light = shared.light[k];
    for (int c = 0; c < 3; ++c) shared.color_sums.push_back(sum[c]);
    if (k < shared.clustered) continue;
    if (!lamps.empty() && lamps.back().light->group != light->group) plant();
    if (lamps.empty() || lamps.back().light != light)
      lamps.push_back({light, number, number, number, sample.light.shape == LightShape::kDisc});
    lamps.back().end = number + 1;
    if (sample.drawn) continue;
    lamps.back().last = number;
    sum = sum + 1 / sample.light.count * light->color;
  }
  for (int c = 0; c < 3; ++c) shared.color_sums.push_back(sum[c]);
  plant();
}

}  // namespace

void DirectLight::find_sharing() {
  uint32_t lamps = 0, samples = 1;
  for (const Light& light : scene_.lights) {
    const bool is_lamp = !light.is_dome() && !light.is_tabled();
    lamps_.takes_part.push_back(is_lamp && light.casts_shadow() && !light.program);
    glow_.takes_part.push_back(light.is_medium());
    glow_.on |= light.is_medium();
    if (!lamps_.takes_part.back()) continue;
    ++lamps;
    samples = std::max(samples, plan_.samples_of(light));
  }
  for (SharedLight* shared : {&lamps_, &glow_})
    if (plan_.passes >> GLINT_PASS_LIGHT_GROUPS & 1)
      shared->group_count = scene_.light_group_count + 1;
  lamps_.on = plan_.lamp_shadows > 0 && lamps > 2 * uint64_t(plan_.lamp_shadows);
  lamps_.rays = uint32_t(std::min(uint64_t(plan_.lamp_shadows) * samples, kMostRays));
  glow_.rays = plan_.medium_shadows;
}

void DirectLight::share(SharedLight& shared, const Batch& batch, uint32_t sample,
                        RayCounts& counts) {
  if (std::none_of(batch.lit.begin(), batch.lit.begin() + std::ptrdiff_t(batch.size()),
                   [](int64_t lit) { return lit != 0; }))
    return;
  shared.lit = batch.lit.data();
  place_sums(shared, batch.size());
  place_groups(shared, batch.size());
  list_samples(shared, batch, sample);
  choose(shared, batch, sample);
  shared.shining = shared.white = points_;
  // Their contribution is known: the rays alone are wanted, which pass fibres.
  LobeColumns& lobes = shared.white.lobes;
  if (!lobes.has_fibre) lobes.highlights = 0;
  if (!lobes.has_fibre) lobes.other_count = 0;
  shared.white.gloss[0] = nullptr;
  for (const double*& column : shared.white.diffuse) column = shared.ones;
  const AskedLamp* begin = shared.sorted.data();
  for (size_t number = 0; number < shared.samples.size() && !cancel_; ++number) {
    const AskedLamp* const end = shared.sorted.data() + shared.ends[number];
    if (begin != end) ask(shared, batch, number, begin, end, counts);
    begin = end;
  }
  add_shared(shared, batch);
}

/// In how many parts the samples are taken.
uint32_t DirectLight::shared_parts(const SharedLight& shared) const {
  uint32_t parts = 1;
  for (size_t k = 0; k < scene_.lights.size(); ++k)
    if (shared.takes_part[k])
      parts = std::max(parts, plan_.parts_of(scene_.lights[k], false, takes_few_));
  return parts;
}

/// Each sample of each lamp, those that are seen in clusters last.
void DirectLight::list_samples(SharedLight& shared, const Batch& batch, uint32_t sample) {
  shared.samples.clear();
  shared.light.clear();
  shared.groups.clear();
  shared.receives.clear();
  for (int c = 0; c < 3; ++c) rays_.end[c] = glassy_ ? ends_[c] : nullptr;
  shared.shows_gloss = &shared != &lamps_ && shows_even_gloss(*batch.queue);
  for (int c = 0; c < 3; ++c) points_.gloss[c] = shared.shows_gloss ? shared.gloss[c] : nullptr;
  shared.near.resize(shared.columns.rows());
  for (const bool clustered : {false, true}) {
    shared.clustered = shared.samples.size();
    for (size_t k = 0; k < scene_.lights.size(); ++k) {
      const Light& light = scene_.lights[k];
      if (!shared.takes_part[k] || is_clustered(light) != clustered) continue;
      list_samples_of(shared, light, sample,
                      clustered ? shared.near.data() : receivers(shared, batch, light));
    }
  }
  if (shared.color_sums.empty()) find_clusters(shared);
}

bool DirectLight::is_clustered(const Light& light) const {
  return plan_.physical() && light.is_clustered();
}

void DirectLight::list_samples_of(SharedLight& shared, const Light& light, uint32_t sample,
                                  const int64_t* lit) {
  const uint32_t parts = plan_.parts_of(light, false, takes_few_), all = plan_.samples_of(light),
                 count = all / parts, first = sample % parts * count;
  const LightPolicy policy = policy_of(light);
  for (uint32_t j = first; j < first + count; ++j) {
    const LightPoint point = plan_.light_point(light, sample, j);
    LampSample lamp{light.sample(point, all, plan_.physical(), policy), policy, lit, false};
    if (parts > 1) lamp.light.count = count;
    for (const bool drawn : {false, true}) {
      if (drawn && !(policy.draws && lamp.light.draws.on)) continue;
      lamp.drawn = drawn;
      shared.samples.push_back(lamp);
      shared.light.push_back(&light);
      shared.groups.push_back(std::min(uint32_t(point.group), scene_.light_group_count));
    }
  }
}

/// The mask of the points that a lamp may light.
const int64_t* DirectLight::receivers(SharedLight& shared, const Batch& batch, const Light& light) {
  if (light.lights_all()) return shared.lit;
  find_lit(batch, light);
  return shared.receives.emplace_back(linked_).data();
}

/// Which samples each point asks, by sample.
void DirectLight::choose(SharedLight& shared, const Batch& batch, uint32_t sample) {
  const size_t most = shared.samples.size() + shared.clusters.size();
  shared.given.resize(3 * kShareBlock * most);
  shared.reaching.resize(most);
  ShareStage stage{};
  stage.points = &points_;
  stage.lit = shared.lit;
  stage.samples = shared.samples.data();
  stage.sample_count = shared.samples.size();
  stage.offset = mark_offset(sample);
  stage.asked = std::max(shared.rays / shared_parts(shared), 1u);
  for (int c = 0; c < 3; ++c) {
    stage.diffuse[c] = shared.diffuse[c];
    stage.specular[c] = shared.specular[c];
  }
  for (int c = 0; c < 3; ++c) stage.gloss[c] = shared.shows_gloss ? shared.gloss[c] : nullptr;
  stage.total = shared.total;
  stage.clusters = shared.clusters.data();
  stage.cluster_count = shared.clusters.size();
  stage.clustered = shared.clustered;
  stage.color_sums = shared.color_sums.data();
  stage.near = shared.near.data();
  stage.reaching = shared.reaching.data();
  stage.given = shared.given.data();
  stage.chosen = shared.chosen.data();
  stage.groups = shared.group_count ? shared.groups.data() : nullptr;
  stage.group_given = shared.group_given.data();
  const size_t count = stages_.share(stage);
  sort_chosen(shared, count);
}

/// Looks for what is between the points [begin, end) and one sample.
void DirectLight::ask(SharedLight& shared, const Batch& batch, size_t number,
                      const AskedLamp* begin, const AskedLamp* end, RayCounts& counts) {
  const Light& light = *shared.light[number];
  LampSample& lamp = shared.samples[number];
  LitPoints& points = lamp.drawn ? shared.shining : shared.white;
  lamp.lit = shared.asks.data();
  if (!lamp.drawn) lamp.policy.draws = false;
  lamp.policy.on_diffuse = true;
  size_t first = batch.size(), last = 0;
  for (const AskedLamp* p = begin; p != end; ++p) {
    shared.asks[p->point] = -1;
    shared.place[p->point] = uint32_t(p - begin);
    first = std::min(first, size_t(p->point));
    last = std::max(last, size_t(p->point));
  }
  points.first = first / kPad * kPad;
  points.count = last + 1;
  const size_t count = (lamp.drawn ? stages_.gloss : stages_.light)(points, lamp, rays_);
  for (size_t k = 0; batch.soft_light && k < count; ++k)
    batch.mark_soft_light(point_[k], Refinement::kReached);
  for (size_t k = 0; batch.cost && k < count; ++k) batch.charge(point_[k]);
  met_by_ = lamp.drawn ? kMirror : kShadow;
  if (glassy_)
    transparent_shadows_.trace(rays_, lamp.light.shape, opacity(light), zeros_, count, shadow_,
                               counts, met_by_);
  else find_shadows(light, count, nullptr, counts);
  met_by_ = kShadow;
  if (scene_.features & GLINT_FEATURE_MEDIA) dim_shadows(light, count, counts);
  for (size_t k = 0; k < count; ++k) {
    const uint32_t point = point_[k];
    const AskedLamp& chosen = begin[shared.place[point]];
    Vec3d asked{chosen.light[0], chosen.light[1], chosen.light[2]};
    if (chosen.middle > 0)
      asked = lamp.light.count * beside_middle(light, chosen, row(rays_.diffuse, k)) * asked;
    const Vec3d open = shadow_[0] ? row(shadow_, k) : Vec3d{1, 1, 1} * double(!blocked_[k]);
    set_row(shared.asked, point, row(shared.asked, point) + asked);
    set_row(shared.passed, point, row(shared.passed, point) + open * asked);
    for (size_t c = 0; shared.group_count && c < 3; ++c) {
      const size_t column = 3 * size_t(shared.groups[number]) + c;
      shared.group_asked[column][point] += asked[int(c)];
      shared.group_passed[column][point] += open[int(c)] * asked[int(c)];
    }
  }
  for (const AskedLamp* p = begin; p != end; ++p) shared.asks[p->point] = 0;
}

/// Adds what all lamps give, with the shadows of those that were asked.
void DirectLight::add_shared(const SharedLight& shared, const Batch& batch) const {
  const SumColumns& sums = batch.sums;
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!(shared.total[k] > 0)) continue;
    const Vec3d diffuse = row(shared.diffuse, k), specular = row(shared.specular, k),
                full = diffuse + specular,
                open = share_open(row(shared.asked, k), row(shared.passed, k), {1, 1, 1});
    Batch::add_to(sums.total, k, open * full);
    Batch::add_to(sums.diffuse, k, diffuse);
    Batch::add_to(sums.specular, k, specular);
    Batch::add_to(sums.shadow, k, open * full - full);
    if (batch.has_groups()) share_groups(shared, batch, k, open);
    if (!batch.splits()) continue;
    Batch::add_to(batch.lit_diffuse, k, open * diffuse);
    Batch::add_to(batch.lit_specular, k, open * specular);
  }
}

/// What each group of lights gives to point k, by what got through of those of it that were asked;
/// and what is left between the sum of these and all is shared out, so that they are all together.
void DirectLight::share_groups(const SharedLight& shared, const Batch& batch, size_t k,
                               Vec3d open) const {
  const auto at = [&](const std::vector<double*>& columns, size_t group) {
    return Vec3d{columns[3 * group][k], columns[3 * group + 1][k], columns[3 * group + 2][k]};
  };
  const auto lit = [&](size_t group) {
    return share_open(at(shared.group_asked, group), at(shared.group_passed, group), open) *
           at(shared.group_given, group);
  };
  Vec3d sum, size;
  for (size_t group = 0; group < shared.group_count; ++group) {
    const Vec3d own = lit(group);
    sum += own;
    size += Vec3d{std::fabs(own.x), std::fabs(own.y), std::fabs(own.z)};
  }
  const Vec3d left = open * (row(shared.diffuse, k) + row(shared.specular, k)) - sum;
  for (size_t group = 0; group + 1 < shared.group_count; ++group) {
    Vec3d own = lit(group);
    for (int c = 0; c < 3; ++c)
      if (size[c] > 0) own[c] += left[c] * (std::fabs(own[c]) / size[c]);
    batch.add_to_group(int(group), k, own);
  }
}

}  // namespace glint
