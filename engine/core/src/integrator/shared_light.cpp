#include "integrator/shared_light.h"

#include <algorithm>

#include "math/math.h"

namespace glint {
namespace {

constexpr uint64_t kMostRays = 4096;  // that lamps share at a point in a pixel's sample

/// Where the first of a sample's rays is: of n samples each in another of n places between two
/// rays (van der Corput's sequence), none where sums of alike lamps end.
double mark_offset(uint32_t sample) {
  uint32_t reversed = 0;
  for (int bit = 0; bit < 32; ++bit) reversed |= (sample >> bit & 1u) << (31 - bit);
  const double offset = double(reversed) * 0x1p-32 + 0.3819660112501051;
  return offset < 1 ? offset : offset - 1;
}

/// How much more a lamp gives than the middle of its cluster does, for colours alike. given: by the
/// sample to a white point.
double beside_middle(const Light& light, const ShadowRequest& chosen, const Vec3d& given) {
  const Vec3d& color = light.color;
  return (given.x + given.y + given.z) / ((color.x + color.y + color.z) * chosen.middle);
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

}  // namespace

void SharedSums::clear(size_t points, size_t groups) {
  columns.reserve(points);
  size_t next = 0;
  for (auto* sum : {&diffuse, &specular, &asked, &passed, &gloss})
    for (double*& column : *sum) column = columns[next++];
  total = columns[next++];
  ones = columns[next++];
  std::fill_n(ones, columns.rows(), 1.0);
  for (auto* sum : {&asked, &passed})
    for (double* column : *sum) std::fill_n(column, points, 0.0);
  if (groups == 0) return;
  if (group_total.empty()) group_columns = Columns(9 * groups);
  group_columns.reserve(points);
  next = 0;
  for (auto* sums : {&group_total, &group_asked, &group_passed}) {
    sums->resize(3 * groups);
    for (double*& column : *sums) {
      column = group_columns[next++];
      std::fill_n(column, group_columns.rows(), 0.0);
    }
  }
}

void ShadowRequests::sort(size_t count, size_t samples) {
  ends.assign(samples + 1, 0);
  for (size_t k = 0; k < count; ++k) ++ends[chosen[k].sample + 1];
  for (size_t number = 1; number < ends.size(); ++number) ends[number] += ends[number - 1];
  sorted.resize(count);
  for (size_t k = 0; k < count; ++k) sorted[ends[chosen[k].sample]++] = chosen[k];
}

SharedLight::SharedLight(Kind kind, LitBatch& lit) : LightContext(lit), kind_(kind), lit_(lit) {
  uint32_t count = 0, samples = 1;
  for (const Light& light : scene.lights) {
    const bool is_lamp = !light.is_dome() && !light.is_tabled();
    takes_part_.push_back(kind == kMedia ? light.is_medium()
                                         : is_lamp && light.casts_shadow() && !light.program);
    if (!takes_part_.back()) continue;
    ++count;
    samples = std::max(samples, plan.samples_of(light));
    varies_ |= light.is_medium() || plan.samples_of(light) > 1;
  }
  if (plan.passes >> GLINT_PASS_LIGHT_GROUPS & 1) group_count_ = scene.light_group_count + 1;
  on_ =
      kind == kMedia ? count > 0 : plan.lamp_shadows > 0 && count > 2 * uint64_t(plan.lamp_shadows);
  rays_ = kind == kMedia ? plan.medium_shadows
                         : uint32_t(std::min(uint64_t(plan.lamp_shadows) * samples, kMostRays));
}

void SharedLight::add(const Batch& batch, uint32_t sample, bool few) {
  if (std::none_of(batch.lit, batch.lit + batch.size(), [](int64_t lit) { return lit != 0; }))
    return;
  few_ = few;
  sums_.clear(batch.size(), group_count_);
  requests_.asks.assign(sums_.columns.rows(), 0);
  requests_.place.resize(sums_.columns.rows());
  requests_.chosen.resize(rays_ * batch.size());
  const bool shows_gloss = kind_ == kMedia && lit_.shows_even_gloss(*batch.queue);
  for (int c = 0; c < 3; ++c) lit_.points.gloss[c] = shows_gloss ? sums_.gloss[c] : nullptr;
  lit_.ask_ends(false);
  list_samples(batch, sample);
  choose(batch, sample);
  shining_ = white_ = lit_.points;
  // Their contribution is known: the rays alone are wanted, which pass fibres.
  if (!white_.lobes.has_fibre) white_.lobes.highlights = 0;
  if (!white_.lobes.has_fibre) white_.lobes.other_count = 0;
  white_.gloss[0] = nullptr;
  for (double*& column : white_.diffuse) column = sums_.ones;
  uint32_t begin = 0;
  for (size_t number = 0; lit_.hides && number < samples_.lamps.size() && !cancel; ++number) {
    const uint32_t end = requests_.ends[number];
    if (begin != end) ask(batch, number, begin, end);
    begin = end;
  }
  trace(batch);
  add_to_sums(batch);
}

/// The same for all batches: which samples there are does not depend on these. Each group of lights
/// has a tree of its own.
void SharedLight::find_clusters() {
  SharedSamples& all = samples_;
  std::vector<ClusteredLamp> lamps;
  const auto plant = [&] {
    const uint32_t first = uint32_t(all.clusters.size());
    for (LampCluster cluster : clusters_of(lamps)) {
      cluster.next += first;
      all.clusters.push_back(cluster);
    }
    lamps.clear();
  };
  Vec3d sum{};
  for (size_t k = 0; k < all.lamps.size(); ++k) {
    const LampSample& sample = all.lamps[k];
    const uint32_t number = uint32_t(k);
    const Light* const light = all.lights[k];
    for (int c = 0; c < 3; ++c) all.color_sums.push_back(sum[c]);
    if (k < all.clustered) continue;
    if (!lamps.empty() && lamps.back().light->group != light->group) plant();
    if (lamps.empty() || lamps.back().light != light)
      lamps.push_back({light, number, number, number, sample.light.shape == LightShape::kDisc});
    lamps.back().end = number + 1;
    if (sample.drawn) continue;
    lamps.back().last = number;
    sum = sum + 1 / sample.light.count * light->color;
  }
  for (int c = 0; c < 3; ++c) all.color_sums.push_back(sum[c]);
  plant();
}

/// In how many parts the samples are taken.
uint32_t SharedLight::parts() const {
  uint32_t parts = 1;
  for (const Light& light : scene.lights)
    if (takes_part_[light.number]) parts = std::max(parts, plan.parts_of(light, false, few_));
  return parts;
}

/// Each sample of each lamp, those that are seen in clusters last. All but whom they reach is the
/// same for all batches of a pixel's sample, and for all samples where none has several.
void SharedLight::list_samples(const Batch& batch, uint32_t sample) {
  near_.resize(sums_.columns.rows());
  const Listed wanted{varies_ ? sample : 0, few_, near_.data()};
  if (listed_ != wanted) {
    listed_ = wanted;
    samples_.lamps.clear();
    samples_.lights.clear();
    samples_.groups.clear();
    for (const bool clustered : {false, true}) {
      samples_.clustered = samples_.lamps.size();
      for (const Light& light : scene.lights)
        if (takes_part_[light.number] && (plan.physical() && light.is_clustered()) == clustered)
          list_samples_of(light, sample);
    }
    if (samples_.color_sums.empty()) find_clusters();
  }
  receives_.clear();
  const Light* before = nullptr;
  for (size_t k = 0; k < samples_.clustered; ++k) {
    const Light* const light = samples_.lights[k];
    samples_.lamps[k].lit = light == before ? samples_.lamps[k - 1].lit
                            : light->lights_all()
                                ? batch.lit
                                : lit_.receivers(batch, *light, receives_.emplace_back());
    before = light;
  }
}

void SharedLight::list_samples_of(const Light& light, uint32_t sample) {
  const uint32_t parts = plan.parts_of(light, false, few_), all = plan.samples_of(light),
                 count = all / parts, first = sample % parts * count;
  const LightPolicy policy = lit_.policy_of(light);
  for (uint32_t j = first; j < first + count; ++j) {
    const LightPoint point = plan.light_point(light, sample, j);
    LampSample lamp{light.sample(point, all, plan.physical(), policy), policy, near_.data(), false};
    if (parts > 1) lamp.light.count = count;
    for (const bool drawn : {false, true}) {
      if (drawn && !(policy.draws && lamp.light.draws.on)) continue;
      lamp.drawn = drawn;
      samples_.lamps.push_back(lamp);
      samples_.lights.push_back(&light);
      samples_.groups.push_back(std::min(uint32_t(point.group), scene.light_group_count));
    }
  }
}

/// Of a point. Light that bounced is dealt over blocks of more pixels, of which each asks for as
/// much less.
uint32_t SharedLight::rays_of(const Batch& batch) const {
  const bool dealt = kind_ == kLamps && batch.queue->gathers() && plan.interleaving > 1;
  if (dealt) return std::max(rays_ / RenderPlan::kBounceParts, 1u);
  return std::max(rays_ / parts(), 1u);
}

/// Which samples each point asks, by sample.
void SharedLight::choose(const Batch& batch, uint32_t sample) {
  const size_t most = samples_.lamps.size() + samples_.clusters.size();
  const size_t of_blocks = kShareBlock * samples_.clustered, of_lanes = kPad * most;
  requests_.contributions.resize(3 * (of_blocks + of_lanes));
  requests_.reaching.resize(most);
  ShareStage stage{};
  stage.points = &lit_.points;
  stage.lit = batch.lit;
  stage.samples = samples_.lamps.data();
  stage.sample_count = samples_.lamps.size();
  stage.offset = mark_offset(sample);
  stage.rays = rays_of(batch);
  for (int c = 0; c < 3; ++c) {
    stage.diffuse[c] = sums_.diffuse[c];
    stage.specular[c] = sums_.specular[c];
    stage.gloss[c] = lit_.points.gloss[c] ? sums_.gloss[c] : nullptr;
  }
  stage.total = sums_.total;
  stage.clusters = samples_.clusters.data();
  stage.cluster_count = samples_.clusters.size();
  stage.clustered = samples_.clustered;
  stage.color_sums = samples_.color_sums.data();
  stage.near = near_.data();
  stage.reaching = requests_.reaching.data();
  stage.contributions = requests_.contributions.data();
  stage.chosen = requests_.chosen.data();
  stage.groups = group_count_ ? samples_.groups.data() : nullptr;
  stage.group_total = sums_.group_total.data();
  requests_.sort(stages.share(stage), samples_.lamps.size());
}

/// Whether shadow rays to two samples may be traced at once.
bool SharedLight::are_alike(size_t a, size_t b) const {
  const LampSample &one = samples_.lamps[a], &other = samples_.lamps[b];
  return one.drawn == other.drawn && one.light.shape == other.light.shape &&
         samples_.lights[a]->passed_sets == 0 && samples_.lights[b]->passed_sets == 0;
}

/// Adds the rays of the requests [begin, end), of one sample, to those that wait.
void SharedLight::ask(const Batch& batch, size_t number, uint32_t begin, uint32_t end) {
  WaitingShadows& waiting = requests_.waiting;
  const bool fits = waiting.count() + batch.size() + kPad <= lit_.rows();
  if (waiting.count() > 0 && !(fits && are_alike(waiting.number, number))) trace(batch);
  LampSample lamp = samples_.lamps[number];
  LitPoints& points = lamp.drawn ? shining_ : white_;
  lamp.lit = requests_.asks.data();
  lamp.policy.draws &= lamp.drawn;
  lamp.policy.on_diffuse = true;
  const ShadowRequest* const sorted = requests_.sorted.data();
  size_t first = batch.size(), last = 0;
  for (uint32_t i = begin; i < end; ++i) {
    const uint32_t point = sorted[i].point;
    requests_.asks[point] = -1;
    requests_.place[point] = i;
    first = std::min(first, size_t(point));
    last = std::max(last, size_t(point));
  }
  points.first = first / kPad * kPad;
  points.count = last + 1;
  const ShadowRays rays = lit_.rays_from(waiting.count());
  const size_t count = (lamp.drawn ? stages.gloss : stages.light)(points, lamp, rays);
  waiting.number = number;
  for (size_t k = 0; k < count; ++k) waiting.requests.push_back(requests_.place[rays.point[k]]);
  for (uint32_t i = begin; i < end; ++i) requests_.asks[sorted[i].point] = 0;
}

/// Looks for what is in the way of the rays that wait.
void SharedLight::trace(const Batch& batch) {
  WaitingShadows& waiting = requests_.waiting;
  const size_t count = waiting.count();
  if (count == 0) return;
  const LampSample& like = samples_.lamps[waiting.number];
  lit_.charge(batch, count, true, true);
  lit_.visibility = like.drawn ? kMirror : kShadow;
  lit_.trace(*samples_.lights[waiting.number], like.light.shape, count, true, nullptr);
  lit_.visibility = kShadow;
  for (size_t k = 0; k < count; ++k) {
    const ShadowRequest& chosen = requests_.sorted[waiting.requests[k]];
    const uint32_t point = chosen.point, number = chosen.sample;
    Vec3d asked{chosen.light[0], chosen.light[1], chosen.light[2]};
    if (chosen.middle > 0)
      asked = samples_.lamps[number].light.count *
              beside_middle(*samples_.lights[number], chosen, row(lit_.rays.diffuse, k)) * asked;
    const Vec3d passed = lit_.open(k) * asked;
    set_row(sums_.asked, point, row(sums_.asked, point) + asked);
    set_row(sums_.passed, point, row(sums_.passed, point) + passed);
    for (size_t c = 0; group_count_ && c < 3; ++c) {
      const size_t column = 3 * size_t(samples_.groups[number]) + c;
      sums_.group_asked[column][point] += asked[int(c)];
      sums_.group_passed[column][point] += passed[int(c)];
    }
  }
  waiting.requests.clear();
}

/// Adds what all lamps give, with the shadows of those that were asked.
void SharedLight::add_to_sums(const Batch& batch) const {
  const SumColumns& sums = batch.sums;
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!(sums_.total[k] > 0)) continue;
    const Vec3d diffuse = row(sums_.diffuse, k), specular = row(sums_.specular, k),
                full = diffuse + specular,
                open = share_open(row(sums_.asked, k), row(sums_.passed, k), {1, 1, 1});
    Batch::add_to(sums.total, k, open * full);
    Batch::add_to(sums.diffuse, k, diffuse);
    Batch::add_to(sums.specular, k, specular);
    Batch::add_to(sums.shadow, k, open * full - full);
    if (batch.has_groups()) share_groups(batch, k, open);
    if (!batch.splits()) continue;
    Batch::add_to(batch.lit_diffuse, k, open * diffuse);
    Batch::add_to(batch.lit_specular, k, open * specular);
  }
}

/// What each group of lights gives to point k, by what got through of those of it that were asked;
/// and what is left between the sum of these and all is shared out, so that they are all together.
void SharedLight::share_groups(const Batch& batch, size_t k, Vec3d open) const {
  const auto at = [&](const std::vector<double*>& columns, size_t group) {
    return Vec3d{columns[3 * group][k], columns[3 * group + 1][k], columns[3 * group + 2][k]};
  };
  const auto lit = [&](size_t group) {
    return share_open(at(sums_.group_asked, group), at(sums_.group_passed, group), open) *
           at(sums_.group_total, group);
  };
  Vec3d sum, size;
  for (size_t group = 0; group < group_count_; ++group) {
    const Vec3d own = lit(group);
    sum += own;
    size += Vec3d{std::fabs(own.x), std::fabs(own.y), std::fabs(own.z)};
  }
  const Vec3d left = open * (row(sums_.diffuse, k) + row(sums_.specular, k)) - sum;
  for (size_t group = 0; group + 1 < group_count_; ++group) {
    Vec3d own = lit(group);
    for (int c = 0; c < 3; ++c)
      if (size[c] > 0) own[c] += left[c] * (std::fabs(own[c]) / size[c]);
    batch.add_to_group(int(group), k, own);
  }
}

}  // namespace glint
