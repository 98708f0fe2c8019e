// Many lamps (SEMANTICS.md): all of them light a point, and some are asked for their shadows, which
// stand for those of all.
#include <algorithm>

#include "integrator/direct.h"
#include "session/timer.h"
#include "shading/surface.h"

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

}  // namespace

void DirectLight::find_sharing() {
  uint32_t lamps = 0, samples = 1;
  for (const Light& light : scene_.lights) {
    const bool is_lamp = !light.is_dome() && !light.is_surface();
    shared_.takes_part.push_back(is_lamp && light.casts_shadow() && !light.program);
    if (!shared_.takes_part.back()) continue;
    ++lamps;
    samples = std::max(samples, plan_.samples_of(light));
  }
  shared_.on = plan_.lamp_shadows > 0 && lamps > 2 * uint64_t(plan_.lamp_shadows);
  shared_.rays = uint32_t(std::min(uint64_t(plan_.lamp_shadows) * samples, kMostRays));
}

void DirectLight::share_lamps(const Batch& batch, uint32_t sample, RayCounts& counts) {
  if (std::none_of(batch.lit.begin(), batch.lit.begin() + std::ptrdiff_t(batch.size()),
                   [](int64_t lit) { return lit != 0; }))
    return;
  place_sums(batch.size());
  list_samples(batch, sample);
  choose(batch, sample);
  const AskedLamp* begin = shared_.sorted.data();
  for (size_t number = 0; number < shared_.samples.size() && !cancel_; ++number) {
    const AskedLamp* const end = shared_.sorted.data() + shared_.ends[number];
    if (begin != end) ask(batch, number, begin, end, counts);
    begin = end;
  }
  add_shared(batch);
}

/// Sets the stage of each sample of each lamp, those that are seen in clusters last.
void DirectLight::list_samples(const Batch& batch, uint32_t sample) {
  shared_.samples.clear();
  shared_.light.clear();
  shared_.receives.clear();
  for (int c = 0; c < 3; ++c) stage_.end_out[c] = glassy_ ? ends_[c] : nullptr;
  stage_.max_specular = scene_.max_specular;
  stage_.sheen_alone = false;
  stage_.lit = batch.lit.data();
  shared_.near.resize(shared_.columns.rows());
  for (const bool clustered : {false, true}) {
    shared_.clustered = shared_.samples.size();
    for (size_t k = 0; k < scene_.lights.size(); ++k) {
      const Light& light = scene_.lights[k];
      if (!shared_.takes_part[k] || is_clustered(light) != clustered) continue;
      list_samples_of(light, sample, clustered ? shared_.near.data() : receivers(batch, light));
    }
  }
  if (shared_.color_sums.empty()) find_clusters();
}

bool DirectLight::is_clustered(const Light& light) const {
  return plan_.physical && light.is_clustered();
}

void DirectLight::list_samples_of(const Light& light, uint32_t sample, const int64_t* lit) {
  const uint32_t count = plan_.samples_of(light);
  for (uint32_t j = 0; j < count; ++j) {
    LightStage stage = stage_;
    light.set(stage, plan_.light_point(light, sample, j), count, plan_.physical);
    stage.lit = lit;
    for (const bool drawn : {false, true}) {
      if (drawn && !stage.draws) continue;
      shared_.samples.push_back({stage, drawn});
      shared_.light.push_back(&light);
    }
  }
}

/// The same for all batches: which samples there are does not depend on these.
void DirectLight::find_clusters() {
  std::vector<ClusteredLamp> lamps;
  Vec3d sum{};
  for (size_t k = 0; k < shared_.samples.size(); ++k) {
    const LampSample& sample = shared_.samples[k];
    const uint32_t number = uint32_t(k);
    const Light* const light = shared_.light[k];
    for (int c = 0; c < 3; ++c) shared_.color_sums.push_back(sum[c]);
    if (k < shared_.clustered) continue;
    if (lamps.empty() || lamps.back().light != light)
      lamps.push_back({light, number, number, number, sample.stage.shape == kDiscSource});
    lamps.back().end = number + 1;
    if (sample.drawn) continue;
    lamps.back().last = number;
    sum = sum + 1 / sample.stage.share * light->color;
  }
  for (int c = 0; c < 3; ++c) shared_.color_sums.push_back(sum[c]);
  shared_.clusters = clusters_of(lamps);
}

/// The mask of the points that a lamp may light.
const int64_t* DirectLight::receivers(const Batch& batch, const Light& light) {
  find_lit(batch, light);
  if (light.lights_all()) return stage_.lit;
  return shared_.receives.emplace_back(linked_).data();
}

void DirectLight::place_sums(size_t points) {
  Columns& columns = shared_.columns;
  columns.reserve(points);
  size_t next = 0;
  for (auto* sum : {&shared_.diffuse, &shared_.specular, &shared_.asked, &shared_.passed})
    for (double*& column : *sum) column = columns[next++];
  shared_.total = columns[next++];
  shared_.ones = columns[next];
  std::fill_n(shared_.ones, columns.rows(), 1.0);
  for (size_t c = 0; c < 3; ++c) {
    std::fill_n(shared_.asked[c], points, 0.0);
    std::fill_n(shared_.passed[c], points, 0.0);
  }
  shared_.asks.assign(columns.rows(), 0);
  shared_.place.resize(columns.rows());
  shared_.chosen.resize(shared_.rays * points);
}

/// Which samples each point asks, by sample.
void DirectLight::choose(const Batch& batch, uint32_t sample) {
  const size_t most = shared_.samples.size() + shared_.clusters.size();
  shared_.given.resize(3 * kShareBlock * most);
  shared_.reaching.resize(most);
  ShareStage stage{};
  stage.count = batch.size();
  stage.lit = batch.lit.data();
  stage.samples = shared_.samples.data();
  stage.sample_count = shared_.samples.size();
  stage.offset = mark_offset(sample);
  stage.asked = shared_.rays;
  for (int c = 0; c < 3; ++c) {
    stage.diffuse[c] = shared_.diffuse[c];
    stage.specular[c] = shared_.specular[c];
    stage.x[c] = batch.points.x[c];
    stage.n[c] = batch.points.n[c];
  }
  stage.total = shared_.total;
  stage.clusters = shared_.clusters.data();
  stage.cluster_count = shared_.clusters.size();
  stage.clustered = shared_.clustered;
  stage.color_sums = shared_.color_sums.data();
  stage.near = shared_.near.data();
  stage.reaching = shared_.reaching.data();
  stage.given = shared_.given.data();
  stage.chosen = shared_.chosen.data();
  const size_t count = stages_.share(stage);
  sort_chosen(count);
}

void DirectLight::sort_chosen(size_t count) {
  std::vector<uint32_t>& ends = shared_.ends;
  ends.assign(shared_.samples.size() + 1, 0);
  for (size_t k = 0; k < count; ++k) ++ends[shared_.chosen[k].sample + 1];
  for (size_t number = 1; number < ends.size(); ++number) ends[number] += ends[number - 1];
  shared_.sorted.resize(count);
  for (size_t k = 0; k < count; ++k)
    shared_.sorted[ends[shared_.chosen[k].sample]++] = shared_.chosen[k];
}

/// Looks for what is between the points [begin, end) and one sample.
void DirectLight::ask(const Batch& batch, size_t number, const AskedLamp* begin,
                      const AskedLamp* end, RayCounts& counts) {
  const Light& light = *shared_.light[number];
  const bool drawn = shared_.samples[number].drawn;
  stage_ = shared_.samples[number].stage;
  stage_.lit = shared_.asks.data();
  size_t first = batch.size(), last = 0;
  for (const AskedLamp* p = begin; p != end; ++p) {
    shared_.asks[p->point] = -1;
    shared_.place[p->point] = uint32_t(p - begin);
    first = std::min(first, size_t(p->point));
    last = std::max(last, size_t(p->point));
  }
  stage_.first = first / kPad * kPad;
  stage_.count = last + 1;
  if (!drawn) {  // what it gives is known: the rays alone are wanted
    stage_.max_specular = 0;
    stage_.draws = false;
    for (const double*& column : stage_.diffuse) column = shared_.ones;
  }
  const size_t count = drawn ? stages_.gloss(stage_) : stages_.light(stage_);
  for (size_t k = 0; batch.softly_lit && k < count; ++k)
    batch.mark_softly_lit(point_[k], Refinement::kReached);
  for (size_t k = 0; batch.cost && k < count; ++k) batch.charge(point_[k]);
  if (glassy_)
    transparent_shadows_.trace(batch, stage_, opacity(light), zeros_, count, shadow_, counts);
  else find_shadows(light, count, nullptr, counts);
  if (scene_.features & GLINT_FEATURE_MEDIA) dim_shadows(light, count, counts);
  for (size_t k = 0; k < count; ++k) {
    const uint32_t point = point_[k];
    const AskedLamp& chosen = begin[shared_.place[point]];
    Vec3d asked{chosen.light[0], chosen.light[1], chosen.light[2]};
    if (chosen.middle > 0)
      asked = stage_.share * beside_middle(light, chosen, row(stage_.diffuse_out, k)) * asked;
    const Vec3d open = shadow_[0] ? row(shadow_, k) : Vec3d{1, 1, 1} * double(!blocked_[k]);
    set_row(shared_.asked, point, row(shared_.asked, point) + asked);
    set_row(shared_.passed, point, row(shared_.passed, point) + open * asked);
  }
  for (const AskedLamp* p = begin; p != end; ++p) shared_.asks[p->point] = 0;
}

/// Adds what all lamps give, with the shadows of those that were asked.
void DirectLight::add_shared(const Batch& batch) const {
  for (size_t k = 0; k < batch.size(); ++k) {
    if (!(shared_.total[k] > 0)) continue;
    const Vec3d asked = row(shared_.asked, k), passed = row(shared_.passed, k),
                diffuse = row(shared_.diffuse, k), specular = row(shared_.specular, k),
                full = diffuse + specular;
    const double all = asked.x + asked.y + asked.z,
                 mean = all > 0 ? (passed.x + passed.y + passed.z) / all : 1;
    Vec3d open;
    for (int c = 0; c < 3; ++c)
      open[c] = std::clamp(asked[c] > 0 ? passed[c] / asked[c] : mean, 0.0, 1.0);
    const SumColumns& sums = batch.sums;
    Batch::add_to(sums.total, k, open * full);
    Batch::add_to(sums.diffuse, k, diffuse);
    Batch::add_to(sums.specular, k, specular);
    Batch::add_to(sums.shadow, k, open * full - full);
    if (!batch.splits()) continue;
    Batch::add_to(batch.lit_diffuse, k, open * diffuse);
    Batch::add_to(batch.lit_specular, k, open * specular);
  }
}

}  // namespace glint
