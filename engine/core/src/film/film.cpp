#include "film/film.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>

namespace glint {
namespace {

constexpr double kNoDepth = 1e10;

/// The pass of each light that is resolved, and the part of the picture that has it.
constexpr int kPassOf[kResolvedLights] = {GLINT_PASS_DIFFUSE_DIRECT,
                                          GLINT_PASS_DIFFUSE_INDIRECT,
                                          GLINT_PASS_GLOSSY_DIRECT,
                                          GLINT_PASS_GLOSSY_INDIRECT,
                                          GLINT_PASS_TRANSMISSION_DIRECT,
                                          GLINT_PASS_TRANSMISSION_INDIRECT,
                                          kMirroredLight,
                                          kRefractedLight,
                                          GLINT_PASS_SHADOW_CATCHER,
                                          GLINT_PASS_AMBIENT_OCCLUSION,
                                          kOtherDiffuse,
                                          kOtherGloss,
                                          GLINT_PASS_VOLUME_DIRECT,
                                          GLINT_PASS_VOLUME_INDIRECT};
constexpr int kPartOf[kResolvedLights] = {
    GLINT_PASS_DIFFUSE,     GLINT_PASS_DIFFUSE, GLINT_PASS_SPECULAR, GLINT_PASS_SPECULAR,
    GLINT_PASS_MIRROR,      GLINT_PASS_MIRROR,  GLINT_PASS_MIRROR,   GLINT_PASS_MIRROR,
    GLINT_PASS_ENVIRONMENT, GLINT_PASS_COUNT,   GLINT_PASS_DIFFUSE,  GLINT_PASS_MIRROR,
    GLINT_PASS_DIFFUSE,     GLINT_PASS_DIFFUSE};
/// That of the colour of each kind.
constexpr int kColorOf[kColoredKinds] = {GLINT_PASS_DIFFUSE_COLOR,
                                         GLINT_PASS_GLOSSY_COLOR,
                                         GLINT_PASS_TRANSMISSION_COLOR,
                                         kMirroredColor,
                                         kRefractedColor,
                                         kCaughtAlone,
                                         kUnhidden,
                                         kUnshadowedDiffuse,
                                         kUnshadowedGloss};
/// The light of each set of guides.
constexpr int kSumsOfGuides[kGuideSets] = {GLINT_PASS_COMBINED, kMirroredLight, kRefractedLight};

/// What the passes of the Direct and the Indirect light of each kind show beside their own.
constexpr int kBesideDirect[] = {kOtherDiffuse, kOtherGloss, -1},
              kBesideIndirect[] = {kPhotonLight, kMirroredLight, kRefractedLight};

/// Of what gives light itself.
constexpr int kPassOfGlow[kGlows] = {GLINT_PASS_EMISSION, GLINT_PASS_ENVIRONMENT};

int sums_of(int light) { return light == kCaught ? int(kCaughtLight) : kPassOf[light]; }

/// The sums without which a column of what resolving reads tells nothing.
int sums_of_guide(int number) {
  return number < kHalfLight    ? kSumsOfGuides[number / kGuidesOfOne]
         : number < kHalfColor  ? sums_of(number - kHalfLight)
         : number < kSharpColor ? kColorOf[number - kHalfColor]
                                : kColorOf[number - kSharpColor + kFirstSharp];
}

/// Where the pixel (x, y) of the region is in its tile.
size_t slot_of(const Tile& tile, uint32_t x, uint32_t y) {
  constexpr uint32_t side = Tile::kBlock;
  const uint32_t column = x - tile.x0, row = y - tile.y0, bx = column / side * side,
                 by = row / side * side, high = std::min(side, tile.height() - by),
                 wide = std::min(side, tile.width() - bx);
  return size_t(by) * tile.width() + size_t(bx) * high + size_t(row - by) * wide + (column - bx);
}

/// Throws std::bad_alloc where they are too many to count.
size_t numbers(size_t pixels, size_t channels) {
  if (pixels > std::numeric_limits<size_t>::max() / 16 / channels) throw std::bad_alloc();
  return pixels * channels;
}

/// Numbers [first, first + count) of some channels, pixel by pixel.
template <size_t Channels, size_t Size>
void interleave(const float (&channels)[4][Size], size_t first, size_t count, float* out) {
  for (size_t k = first; k < first + count; ++k)
    for (size_t c = 0; c < Channels; ++c) *out++ = channels[c][k];
}

}  // namespace

size_t Film::channels_of(int pass) const {
  if (pass < 0 || pass >= GLINT_PASS_COUNT) return 0;
  if (pass == GLINT_PASS_COMBINED || pass == GLINT_PASS_VECTOR) return 4;
  if (pass == GLINT_PASS_AOV) return 4 * size_t(aov_count_);
  if (pass == GLINT_PASS_LIGHT_GROUPS) return 3 * size_t(light_groups_);
  if (pass == GLINT_PASS_DENOISING_NORMAL || pass == GLINT_PASS_DENOISING_ALBEDO ||
      pass >= GLINT_PASS_SHADOW_CATCHER)
    return 3;
  if (Cryptomatte::kPasses >> pass & 1) return 2 * cryptomatte_.ids();
  return pass == GLINT_PASS_DEPTH || pass >= GLINT_PASS_OBJECT_INDEX ? 1 : 3;
}

void SlotTable::set(uint32_t width, uint32_t height) {
  if (width == width_ && height == height_) return;
  width_ = width;
  height_ = height;
  columns_.clear();
  rows_.clear();
  columns_.reserve(Tile::kSize * Tile::kSize);
  rows_.reserve(Tile::kSize * Tile::kSize);
  for (uint32_t by = 0; by < height; by += Tile::kBlock)
    for (uint32_t bx = 0; bx < width; bx += Tile::kBlock)
      for (uint32_t y = by; y < std::min(by + Tile::kBlock, height); ++y)
        for (uint32_t x = bx; x < std::min(bx + Tile::kBlock, width); ++x) {
          columns_.push_back(x);
          rows_.push_back(y);
        }
  for (; columns_.size() % kPad; columns_.push_back(0)) rows_.push_back(0);
}

Film::Film(Region region, Region traced, Region shown, Passes passes, double error_threshold,
           uint32_t light_samples, uint32_t crypto_ids, uint32_t aov_count, uint32_t light_groups,
           bool gloss, uint32_t resolved, Passes lights)
    : region_(region),
      shown_(shown),
      passes_(passes | pass_bit(GLINT_PASS_COMBINED)),
      aov_count_(aov_count),
      light_groups_(light_groups),
      cryptomatte_(passes, crypto_ids) {
  std::fill_n(at_, int(kSumCount), -1);
  at_[GLINT_PASS_COMBINED] = 0;
  for (int part = GLINT_PASS_DIFFUSE; part < GLINT_PASS_DEPTH; ++part) keep_sums(part, 3);
  keep_sums(GLINT_PASS_COST, 1);
  keep_sums(GLINT_PASS_FALLBACKS, 1);
  keep_sums(GLINT_PASS_MIST, 1);
  keep_sums(GLINT_PASS_AOV, 4 * int(aov_count));
  keep_sums(GLINT_PASS_DENOISING_NORMAL, 3);
  keep_sums(GLINT_PASS_DENOISING_ALBEDO, 3);
  keep_sums(GLINT_PASS_DENOISING_DEPTH, 1);
  keep_sums(GLINT_PASS_SHADOW_CATCHER, 3);
  keep_sums(GLINT_PASS_AMBIENT_OCCLUSION, 3);
  keep_sums(GLINT_PASS_LIGHT_GROUPS, 3 * int(light_groups));
  // light is told over its colour: all are known or none
  Passes kept = wants_lighting() ? kLightingPasses : 0;
  if (kept) kept |= lights & pass_bit(kPhotonLight);
  if (resolved > 1) kept |= lights | Passes(wants(GLINT_PASS_AMBIENT_OCCLUSION)) << kUnhidden;
  for (int pass = GLINT_PASS_SHADOW_CATCHER; pass < kSumCount; ++pass) {
    if (!(kept >> pass & 1) || at_[pass] >= 0) continue;
    at_[pass] = int(columns_);
    columns_ += 3;
  }
  if (resolved > 1) {
    using Catches = Resolve::Catches;
    const Catches catches = at_[kUnshaded] < 0                          ? Catches::kNone
                            : wants(GLINT_PASS_SHADOW_CATCHER)          ? Catches::kPass
                            : lights & pass_bit(GLINT_PASS_ENVIRONMENT) ? Catches::kColor
                                                                        : Catches::kAlpha;
    uint32_t apart = 0;
    for (int light = 0; passes_ != pass_bit(GLINT_PASS_COMBINED) && light < kResolvedLights;
         ++light)
      if (light != kCaught || catches != Catches::kAlpha)
        apart |= uint32_t(at_[kPassOf[light]] >= 0) << light;
    for (int number = 0; number < kGlows; ++number)
      apart |= uint32_t(at_[kPassOfGlow[number]] >= 0) << (kResolvedLights + number);
    resolve_ = Resolve(resolved, region, apart, catches);
  }
  std::fill_n(guides_, int(kGuideColumns), -1);
  for (int number = 0; resolves() && number < kGuideColumns; ++number)
    if (at_[sums_of_guide(number)] >= 0) guides_[number] = int(columns_++);
  if (resolves()) find_columns_of_rays();
  if (gloss) {
    gloss_ = int(columns_);
    columns_ += 2;
  }
  const size_t pixels = size_t(region.width()) * region.height();
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass) {
    if (!wants(pass)) continue;
    pictures_[pass] = std::make_shared<ZeroedBuffer<float>>(numbers(pixels, channels_of(pass)));
  }
  for (int pass : {GLINT_PASS_DEPTH, GLINT_PASS_GAP})
    if (wants(pass)) std::fill_n(values(pass), pixels, float(kNoDepth));
  cut();
  cryptomatte_.set_tiles(tiles_.size());
  const bool refines = error_threshold > 0 || wants(GLINT_PASS_ERROR);
  if (refines) refinement_ = Refinement(error_threshold, light_samples, region, traced, rows());
  if (wants(GLINT_PASS_ERROR) || (refines && resolves())) estimate_ = ErrorEstimate(region);
}

void Film::find_columns_of_rays() {
  const auto add = [&](int first, int count) {
    for (int c = 0; first >= 0 && c < count; ++c) columns_of_rays_.push_back(uint32_t(first + c));
  };
  add(at_[GLINT_PASS_COMBINED], 4);
  for (int pass : kPassOfGlow) add(at_[pass], 3);
  for (int pass : {GLINT_PASS_COST, GLINT_PASS_FALLBACKS}) add(at_[pass], 1);
  for (int pass : kColorOf) add(at_[pass], 3);
  for (int number = 0; number < kGuidesOfOne; ++number) add(guides_[number], 1);
}

void Film::keep_sums(int pass, int channels) {
  if (wants(pass)) {
    at_[pass] = int(columns_);
    columns_ += size_t(channels);
  }
}

void Film::cut() {
  size_t first = 0;
  for (uint32_t y = 0; y < region_.height(); y += Tile::kSize)
    for (uint32_t x = 0; x < region_.width(); x += Tile::kSize) {
      const uint32_t right = std::min(x + Tile::kSize, region_.width()),
                     top = std::min(y + Tile::kSize, region_.height());
      tiles_.push_back({x, y, right, top, first, first / columns_, tiles_.size()});
      first += columns_ * tiles_.back().stride();
    }
  sums_ = ZeroedBuffer<double>(
      columns_ * tiles_.size() *
      tiles_[0].stride());  // the first tile is the largest: `on_thread` finds room
}

Tile Film::on_thread(const Tile& tile, size_t thread) {
  Tile there = tile;
  there.first_sum = thread * columns_ * tiles_[0].stride();
  std::fill_n(sums_.data() + there.first_sum, columns_ * there.stride(), 0.0);
  return there;
}

void Film::store(int pass, uint32_t pixel, const double* from) {
  if (!wants(pass)) return;
  const size_t count = channels_of(pass);
  for (size_t i = 0; i < count; ++i) values(pass)[size_t(pixel) * count + i] = to_float(from[i]);
}

void Film::set_data(uint32_t pixel, const FirstHit& hit) {
  double object = hit.object, material = hit.material;
  store(GLINT_PASS_GRAZING, pixel, &hit.grazing);
  store(GLINT_PASS_DEPTH, pixel, &hit.depth);
  store(GLINT_PASS_POSITION, pixel, &hit.position.x);
  store(GLINT_PASS_NORMAL, pixel, &hit.normal.x);
  store(GLINT_PASS_UV, pixel, &hit.uv.x);
  store(GLINT_PASS_OBJECT_INDEX, pixel, &object);
  store(GLINT_PASS_MATERIAL_INDEX, pixel, &material);
}

void Film::note_half(const Tile& tile, const std::vector<uint32_t>& slots, uint32_t sample) {
  if (!resolves() || !std::has_single_bit(sample)) return;
  for (int number = kHalfLight; number < kSharpColor; ++number) {
    const double* const from = sums(tile, sums_of_guide(number));
    if (!from) continue;
    double* const to = column_at(tile, guides_[number]);
    for (uint32_t slot : slots)
      to[slot] = from[slot] + from[slot + tile.stride()] + from[slot + 2 * tile.stride()];
  }
}

/// Those of one pixel, each column so far from the next, and of how many rays.
struct Film::PixelSums {
  const double* first;
  size_t stride;
  double count;
  const double* column(int number) const { return first + size_t(number) * stride; }
};

double Film::guide(const PixelSums& pixel, int number) const {
  return guides_[number] < 0 ? 0 : *pixel.column(guides_[number]);
}

/// Of the three channels.
double Film::whole(const PixelSums& pixel, int pass) const {
  if (at_[pass] < 0) return 0;
  const double* const sum = pixel.column(at_[pass]);
  return sum[0] + sum[pixel.stride] + sum[2 * pixel.stride];
}

/// Those of the surfaces of a set, to place `at` of the window.
void Film::read_guides(ResolveWindow& window, size_t at, const PixelSums& pixel,
                       GuideSet set) const {
  const int first = set * kGuidesOfOne;
  if (guides_[first] < 0) return;
  const auto put = [&](int number, double value) {
    window.column(set * ResolveWindow::kGuidesOfOne + number)[at] = to_float(value);
  };
  double normal[3], square = 0;
  for (int c = 0; c < 3; ++c) {
    normal[c] = guide(pixel, first + kGuideNormal + c);
    square += normal[c] * normal[c];
  }
  const double share = guide(pixel, first + kGuideShare);
  const bool is_surface = share > 0 && square > 0 && std::isfinite(square);
  put(ResolveWindow::kSurface, is_surface);
  if (!is_surface) return;
  for (int c = 0; c < 3; ++c) {
    put(ResolveWindow::kNormal + c, normal[c] / std::sqrt(square));
    const double place = guide(pixel, first + kGuidePlace + c) / share;
    put(ResolveWindow::kPlace + c, place);
    put(ResolveWindow::kPlaceLow + c, place - double(to_float(place)));
  }
  put(ResolveWindow::kShare, share / pixel.count);
  put(ResolveWindow::kAlong, std::sqrt(square) / pixel.count);
}

/// The means, to place `at` of the window.
void Film::read(ResolveWindow& window, size_t at, const PixelSums& pixel) const {
  const auto put = [&](int column, double value) { window.column(column)[at] = to_float(value); };
  const double n = pixel.count;
  for (int set = 0; set < kGuideSets; ++set) read_guides(window, at, pixel, GuideSet(set));
  double rest[4];
  for (int c = 0; c < 4; ++c) rest[c] = *pixel.column(at_[GLINT_PASS_COMBINED] + c);
  for (int c = 0; c < 3; ++c) put(ResolveWindow::kWhole + c, rest[c] / n);
  put(ResolveWindow::kInside, 1);
  const auto means = [&](int pass, int column, bool is_light = false) {
    if (at_[pass] < 0) return;
    for (int c = 0; c < 3; ++c) {
      const double sum = *pixel.column(at_[pass] + c);
      put(column + c, sum / n);
      if (is_light) rest[c] -= sum;
    }
  };
  for (int light = 0; light < kResolvedLights; ++light)
    means(sums_of(light), ResolveWindow::kLight + 3 * light, light != kCaught && light != kOpen);
  for (int kind = 0; kind < kColoredKinds; ++kind)
    means(kColorOf[kind], ResolveWindow::kColor + 3 * kind);
  for (int c = 0; c < 3; ++c) put(ResolveWindow::kColor + 3 * kColoredKinds + c, 1);
  means(GLINT_PASS_SHADOW_CATCHER, ResolveWindow::kShadow);
  means(kUnshaded, ResolveWindow::kUnshadedColor);
  for (int c = 0; c < 4; ++c) put(ResolveWindow::kRest + c, rest[c] / n);
  for (int k = 0; k < kGlows; ++k) means(kPassOfGlow[k], ResolveWindow::kGlow + 3 * k);
  for (int number = 0; number < kSharpKinds; ++number) {
    const double color = whole(pixel, kColorOf[kFirstSharp + number]),
                 sharp = guide(pixel, kSharpColor + number);
    put(ResolveWindow::kSharp + number, color > 0 ? std::clamp(sharp / color, 0.0, 1.0) : 0);
  }
}

/// How far they are off.
void Film::read_noise(ResolveWindow& window, size_t at, const PixelSums& pixel) const {
  const double n = pixel.count;
  if (n < 2) return;
  const double half = std::bit_floor(uint32_t(n) - 1), rest = n - half;
  const auto put = [&](int column, double before, double after, double first, double second) {
    if (first > 0 && second > 0)
      window.column(column)[at] =
          to_float((before / first - after / second) * std::sqrt(half * rest) / n);
  };
  for (int light = 0; light < kResolvedLights; ++light) {
    if (looked_at(light).front() != light) continue;
    const int kind = kind_of(light);
    const bool colored = kind < kColoredKinds;
    const double color = colored ? guide(pixel, kHalfColor + kind) : 3 * half,
                 all = colored ? whole(pixel, kColorOf[kind]) : 3 * n;
    double before = 0, after = 0;
    for (const int part : looked_at(light)) {
      const double first = guide(pixel, kHalfLight + part);
      before += first;
      after += whole(pixel, sums_of(part)) - first;
    }
    put(ResolveWindow::kNoise + light, before, after, color, all - color);
  }
  for (const auto& [kind, color] :
       {std::pair<int, int>{kUnshadowedMatt, kDiffuseColor}, {kUnshadowedGlossy, kGlossyColor}}) {
    const double before = guide(pixel, kHalfColor + kind), first = guide(pixel, kHalfColor + color);
    put(ResolveWindow::kUnshadowedNoise + kind - kUnshadowedMatt, before,
        whole(pixel, kColorOf[kind]) - before, first, whole(pixel, kColorOf[color]) - first);
  }
}

ResolveWindow Film::window_of(const Tile& tile, uint32_t samples) const {
  const uint32_t reach = resolve_.looks_at(),
                 across = (region_.width() + Tile::kSize - 1) / Tile::kSize;
  ResolveWindow window;
  window.set_size(tile.width() + 2 * reach, tile.height() + 2 * reach);
  for (uint32_t j = 0; j < window.height; ++j)
    for (uint32_t i = 0; i < window.width; ++i) {
      const uint32_t x = tile.x0 + i - reach, y = tile.y0 + j - reach;  // wraps below 0
      if (x >= region_.width() || y >= region_.height()) continue;
      const Tile& there = tiles_[size_t(y / Tile::kSize) * across + x / Tile::kSize];
      const size_t slot = slot_of(there, x, y), at = size_t(j) * window.width + i;
      const PixelSums pixel{column_at(there, 0) + slot, there.stride(),
                            double(refinement_.taken(there.first_row + slot, samples))};
      read(window, at, pixel);
      read_noise(window, at, pixel);
    }
  return window;
}

std::vector<uint32_t> Film::uneven(const Tile& tile, const ResolveWindow& window) const {
  const std::vector<uint8_t> which = resolve_.uneven(window);
  std::vector<uint32_t> slots;
  for (uint32_t k = 0; k < tile.pixels(); ++k)
    if (which[k])
      slots.push_back(
          uint32_t(slot_of(tile, tile.x0 + k % tile.width(), tile.y0 + k / tile.width())));
  std::sort(slots.begin(), slots.end());
  return slots;
}

void Film::resolve(const Tile& tile, uint32_t samples, const ResolveWindow& window,
                   const MoreSeen* more) {
  ResolveWindow finer;
  std::vector<uint32_t> rays(tile.pixels(), 0);
  if (more) finer.set_size(tile.width(), tile.height());
  for (size_t k = 0; more && k < more->slots.size(); ++k) rays[more->slots[k]] = more->rays;
  for (uint32_t k = 0; more && k < tile.pixels(); ++k) {
    const size_t slot = slot_of(tile, tile.x0 + k % tile.width(), tile.y0 + k / tile.width());
    const double taken = refinement_.taken(tile.first_row + slot, samples),
                 all = taken + rays[slot];
    read(finer, k, {more->sums.data() + slot, tile.stride(), all});
    finer.column(ResolveWindow::kSampleShare)[k] = to_float(taken / all);
  }
  resolve_.run(window, more ? &finer : nullptr, tile.x0, tile.y0, samples >= Refinement::kFirst);
}

void Film::measure(const Tile& tile, const SlotTable& slots, uint32_t samples) {
  const double* after = sums(tile, GLINT_PASS_COMBINED);
  std::vector<double> resolved;
  if (resolves()) {
    resolved.assign(after, after + 4 * tile.stride());
    for (size_t k = 0; k < tile.pixels(); ++k) {
      const float* const added = resolve_.added(slots.pixel(tile, k, region_.width()));
      const double taken = refinement_.taken(tile.first_row + k, samples);
      for (size_t c = 0; c < 4; ++c) resolved[c * tile.stride() + k] += taken * double(added[c]);
    }
    after = resolved.data();
  }
  const float* before = values(GLINT_PASS_COMBINED);
  if (estimate_.on())
    estimate_.measure(tile, slots, refinement_, before, after, tile.stride(), samples);
  if (samples >= Refinement::kFirst)
    refinement_.measure(tile, slots, after, tile.stride(), samples);
}

void Film::measure_neighborhood(const Tile& tile) {
  if (estimate_.on()) estimate_.measure_neighborhood(tile);
  refinement_.measure_neighborhood(tile);
}

void Film::publish(const Tile& tile, const SlotTable& slots, uint32_t samples,
                   const Stages& stages) {
  // a pixel that rests takes in light of others, which may not
  const bool rested =
      !resolves() &&
      refinement_.rested(tile, samples);  // its pixels are in the picture as they are
  for (int pass = 0; pass < GLINT_PASS_DEPTH; ++pass)
    if (sums(tile, pass) && (!rested || renewed_ >> pass & 1))
      publish_means(tile, pass, slots, samples, stages);
  for (int pass : {GLINT_PASS_MIST, GLINT_PASS_SHADOW_CATCHER})
    if (wants(pass)) publish_seen(tile, pass, slots, samples, true);
  for (int pass = GLINT_PASS_AOV; pass <= GLINT_PASS_DENOISING_DEPTH; ++pass)
    if (wants(pass)) publish_seen(tile, pass, slots, samples);
  for (int pass : {GLINT_PASS_AMBIENT_OCCLUSION, GLINT_PASS_LIGHT_GROUPS})
    if (wants(pass)) publish_seen(tile, pass, slots, samples);
  if (wants(GLINT_PASS_LIGHT_GROUPS) && resolves()) resolve_groups(tile, slots, samples);
  if (wants_lighting()) publish_lighting(tile, slots, samples);
  if (wants_cryptomatte()) publish_cryptomatte(tile, slots, samples);
  if (passes_ & kHealthPasses) publish_health(tile, slots, samples);
}

void Film::publish_means(const Tile& tile, int pass, const SlotTable& slots, uint32_t samples,
                         const Stages& stages) {
  float means[4][Tile::kSize * Tile::kSize];
  const double* from = sums(tile, pass);
  const size_t count = tile.pixels(), channels = channels_of(pass);
  double taken[Tile::kSize * Tile::kSize];
  const bool differ = refinement_.on() && samples > Refinement::kFirst;
  for (size_t k = 0; differ && k < count; ++k)
    taken[k] = refinement_.taken(tile.first_row + k, samples);
  for (size_t c = 0; c < channels; ++c, from += tile.stride()) {
    if (!differ) stages.mean(from, samples, means[c], count);
    else
      for (size_t k = 0; k < count; ++k) means[c][k] = to_float(from[k] / taken[k]);
  }
  if (resolves()) add_resolved(tile, pass, slots, means);
  for (size_t k = 0; channels == 4 && k < count; ++k) means[3][k] = 1 - means[3][k];
  for (size_t k = 0, run; k < count; k += run) {
    run = slots.run(k);
    float* out = values(pass) + channels * slots.pixel(tile, k, region_.width());
    if (channels == 4) interleave<4>(means, k, run, out);
    else interleave<3>(means, k, run, out);
  }
}

/// What resolving adds to a pass of which light of surfaces is a part, so that parts still sum to
/// Combined: diffuse light and that of media to Diffuse, glossy light to Specular, what passes
/// through to Mirror.
void Film::add_resolved(const Tile& tile, int pass, const SlotTable& slots,
                        float (&means)[4][Tile::kSize * Tile::kSize]) const {
  for (size_t k = 0; k < tile.pixels(); ++k) {
    const uint32_t pixel = slots.pixel(tile, k, region_.width());
    for (size_t c = 0; pass == GLINT_PASS_COMBINED && c < 4; ++c)
      means[c][k] += resolve_.added(pixel)[c];
    for (int light = 0; light < kResolvedLights; ++light) {
      const bool is_part =
          pass == kPartOf[light] && (light != kCaught || !wants(GLINT_PASS_SHADOW_CATCHER));
      for (size_t c = 0; is_part && c < 3; ++c) means[c][k] += resolve_.added_to(light, pixel, c);
    }
    for (int number = 0; number < kGlows; ++number)
      for (size_t c = 0; pass == kPassOfGlow[number] && c < 3; ++c)
        means[c][k] += resolve_.added_to(kResolvedLights + number, pixel, c);
  }
}

void Film::publish_seen(const Tile& tile, int pass, const SlotTable& slots, uint32_t samples,
                        bool is_rest) {
  const double* from = sums(tile, pass);
  const size_t channels = channels_of(pass);
  const auto light = std::find(std::begin(kPassOf), std::end(kPassOf), pass);
  const bool gets_more = resolves() && light != std::end(kPassOf);
  for (size_t c = 0; c < channels; ++c, from += tile.stride())
    for (size_t k = 0; k < tile.pixels(); ++k) {
      const uint32_t pixel = slots.pixel(tile, k, region_.width());
      double mean = from[k] / refinement_.taken(tile.first_row + k, samples);
      if (gets_more) mean += double(resolve_.added_to(int(light - kPassOf), pixel, c));
      values(pass)[channels * pixel + c] = to_float(is_rest ? 1 + mean : mean);
    }
}

/// Groups of lights get as much more as Combined does, so that they still sum to it.
void Film::resolve_groups(const Tile& tile, const SlotTable& slots, uint32_t samples) {
  const double* const combined = sums(tile, GLINT_PASS_COMBINED);
  const size_t channels = channels_of(GLINT_PASS_LIGHT_GROUPS);
  for (size_t k = 0; k < tile.pixels(); ++k) {
    const uint32_t pixel = slots.pixel(tile, k, region_.width());
    const double taken = refinement_.taken(tile.first_row + k, samples);
    float* const groups = values(GLINT_PASS_LIGHT_GROUPS) + channels * pixel;
    for (size_t c = 0; c < channels; ++c) {
      const double all = combined[c % 3 * tile.stride() + k] / taken,
                   more = double(resolve_.added(pixel)[c % 3]);
      if (all > 0) groups[c] = to_float(double(groups[c]) * (1 + more / all));
    }
  }
}

/// Direct and indirect light over its colour, which is 1 where it is 0 and there is light.
void Film::publish_lighting(const Tile& tile, const SlotTable& slots, uint32_t samples) {
  for (int pass = GLINT_PASS_VOLUME_DIRECT; pass <= kLastLighting; ++pass)
    if (wants(pass)) publish_seen(tile, pass, slots, samples);
  for (int first = kFirstLighting; first < GLINT_PASS_VOLUME_DIRECT; first += 3)
    for (size_t c = 0; c < 3; ++c)
      for (size_t k = 0; k < tile.pixels(); ++k) {
        const double taken = refinement_.taken(tile.first_row + k, samples);
        const uint32_t pixel = slots.pixel(tile, k, region_.width());
        const int kind = (first - kFirstLighting) / 3, light = 2 * kind;
        const auto resolved = [&](int pass, int resolved_as) {
          const double* const own = pass < 0 ? nullptr : sums(tile, pass);
          if (!own) return 0.0;
          const bool gets_more = resolves() && resolved_as >= 0;
          const double more = gets_more ? double(resolve_.added_to(resolved_as, pixel, c)) : 0;
          return own[c * tile.stride() + k] + taken * more;
        };
        const double direct = resolved(first, light) +
                              resolved(kBesideDirect[kind], kOtherDiffuseDirect + kind),
                     indirect = resolved(first + 1, light + 1) +
                                resolved(kBesideIndirect[kind], kind ? kMirrored + kind - 1 : -1),
                     color = resolved(first + 2, -1);
        const bool bare = color == 0 && (direct != 0 || indirect != 0);
        const double over = color != 0 ? color : taken;
        const double values_of[3] = {direct / over, indirect / over, bare ? 1 : color / taken};
        for (int part = 0; part < 3; ++part)
          if (wants(first + part))
            values(first + part)[3 * size_t(pixel) + c] = to_float(values_of[part]);
      }
}

void Film::publish_cryptomatte(const Tile& tile, const SlotTable& slots, uint32_t samples) {
  for (int pass = GLINT_PASS_CRYPTO_OBJECT; pass <= GLINT_PASS_CRYPTO_ASSET; ++pass) {
    if (!wants(pass)) continue;
    const size_t channels = channels_of(pass);
    cryptomatte_.each_pixel(pass, tile.number, [&](uint32_t slot, auto begin, auto end) {
      float* out = values(pass) + channels * slots.pixel(tile, slot, region_.width());
      const double taken = refinement_.taken(tile.first_row + slot, samples);
      std::fill_n(out, channels, 0.0f);
      for (size_t k = 0; begin != end && k < channels; k += 2, ++begin) {
        out[k] = Cryptomatte::as_float(begin->id);
        out[k + 1] = to_float(begin->weight / taken);
      }
    });
  }
}

void Film::publish_health(const Tile& tile, const SlotTable& slots, uint32_t samples) {
  const double *traced = sums(tile, GLINT_PASS_COST), *doubted = sums(tile, GLINT_PASS_FALLBACKS);
  for (size_t k = 0; k < tile.pixels(); ++k) {
    const uint32_t pixel = slots.pixel(tile, k, region_.width());
    const double taken = refinement_.taken(tile.first_row + k, samples);
    store(GLINT_PASS_SAMPLES, pixel, &taken);
    if (traced) store(GLINT_PASS_COST, pixel, traced + k);
    if (doubted) store(GLINT_PASS_FALLBACKS, pixel, doubted + k);
    if (!wants(GLINT_PASS_ERROR)) continue;
    const double error = estimate_.levels(pixel, uint32_t(taken));
    store(GLINT_PASS_ERROR, pixel, &error);
  }
}

std::shared_ptr<ZeroedBuffer<float>> Film::picture(int pass, uint64_t size) {
  const size_t channels = channels_of(pass),
               pixels = numbers(size_t(shown_.width()) * shown_.height(), 1);
  if (channels == 0 || !pictures_[pass] || channels * pixels != size) return nullptr;
  if (pictures_[pass]->size() != size) return cropped(pass);
  lent_ |= pass_bit(pass);
  return pictures_[pass];
}

/// The pass of the pixels that are shown, which are not all.
std::shared_ptr<ZeroedBuffer<float>> Film::cropped(int pass) const {
  const size_t channels = channels_of(pass), row = channels * shown_.width();
  const size_t left = shown_.x0 - region_.x0, below = shown_.y0 - region_.y0;
  auto part = std::make_shared<ZeroedBuffer<float>>(row * shown_.height());
  for (size_t y = 0; y < shown_.height(); ++y)
    std::memcpy(part->data() + y * row,
                values(pass) + channels * ((y + below) * region_.width() + left),
                row * sizeof(float));
  return part;
}

void Film::renew() {
  renewed_ = lent_ & ~kDataPasses;
  for (int pass = 0; pass < GLINT_PASS_COUNT; ++pass)
    if (renewed_ >> pass & 1)
      pictures_[pass] = std::make_shared<ZeroedBuffer<float>>(pictures_[pass]->size());
  lent_ = 0;
}

void Film::forget_sums() {
  sums_ = {};
  refinement_ = {};
  estimate_ = {};
  cryptomatte_ = Cryptomatte(passes_, uint32_t(cryptomatte_.ids()));
}

}  // namespace glint
