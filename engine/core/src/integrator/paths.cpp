#include "integrator/paths.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

namespace glint {

namespace {

/// What rough surfaces reflect in a sample is no more than so often the mean of the rest of the
/// pixel's light and of what they reflected in earlier samples, and so much of itself over the
/// square of the samples: of the first two all. The latter two are the more the more the surface
/// gives back: metals show little else.
constexpr double kTimesRest = 2, kTimesBefore = 16, kOwn = 4, kStrong = 0.1;
/// Samples from which on these limits grow with their number, so that many have none.
constexpr uint32_t kSettled = 64;

/// body(N) for the power of two that `count` is, as a constant: loops over a pixel's samples are
/// short.
template <class Body>
void with_constant(uint32_t count, Body body) {
  switch (count) {
    case 1: return body(std::integral_constant<size_t, 1>());
    case 2: return body(std::integral_constant<size_t, 2>());
    case 4: return body(std::integral_constant<size_t, 4>());
    case 8: return body(std::integral_constant<size_t, 8>());
    default: return body(std::integral_constant<size_t, WindowPoints::kMaxPacketSamples>());
  }
}

/// What is known of one channel of a pixel.
struct Accumulator {
  double sum;
  Between range;
  void add(double sample, bool is_first) {
    const double before = sum;
    sum += sample;
    range.add(sum - before, is_first);
  }
};

}  // namespace

void WindowPoints::set(const CameraRays& camera, const RenderPlan& plan, const Tile& tile,
                       Run run) {
  plan_ = &plan;
  const auto [table, first, count, sample] = run;
  first_ = first;
  count_ = count;
  sample_ = sample;
  x0_ = plan.region.x0 + tile.x0;
  y0_ = plan.region.y0 + tile.y0;
  const double column = x0_, row = y0_;
  const double* const offsets = table + 2 * size_t(first);
  for (size_t s = 0; s < count; ++s) {
    for (uint32_t k = 0; k < tile.width(); ++k)
      u_[k * count + s] = camera.u(column + k, offsets[2 * s]);
    for (uint32_t k = 0; k < tile.height(); ++k)
      v_[k * count + s] = camera.v(row + k, offsets[2 * s + 1]);
  }
}

void Paths::choose(const Film& film, const SlotTable& places, const uint32_t* begin,
                   const uint32_t* end, const WindowPoints& points, bool alone) {
  slots_.assign(begin, end);
  first_ = points.first();
  shift_ = uint32_t(__builtin_ctz(points.count()));
  for (std::vector<double>* v : {&u_, &v_}) v->resize((size() + kPad - 1) / kPad * kPad);
  with_constant(points.count(), [&](auto count) { place_samples<count>(places, points); });
  const auto place = [&](const double* table, std::vector<double>* to, size_t width) {
    if (!table) return;
    for (size_t c = 0; c < width; ++c) to[c].resize(u_.size());
    with_constant(points.count(),
                  [&](auto count) { place_rows<count>(places, points, table, to, width); });
  };
  place(points.plan().lens_points, lens_, 2);
  place(points.plan().camera_frames, frame_, 12);
  if (columns_ != film.columns()) sums_ = Columns(columns_ = film.columns());
  sums_.reserve(kMost);
  soft_light_.assign(size(), 0);
  rough_glass_.assign(size(), 0);
  if (alone) {
    for (const uint32_t c : film.columns_of_rays()) std::fill_n(sums_[c], size(), 0.0);
    return;
  }
  for (size_t c = 0; c < columns_; ++c) std::fill_n(sums_[c], size(), 0.0);
  if (!points.plan().reflects_gloss) return;
  if (gloss_.stride() != sums_.stride()) gloss_ = Columns(columns_);
  gloss_.reserve(kMost);
  for (size_t c = 0; c < columns_; ++c) std::fill_n(gloss_[c], size(), 0.0);
  thrown_.assign(size(), 0);
}

void Paths::add_gloss(Film& film, const Tile& tile) {
  const size_t number = size_t(film.gloss_column());
  const double* const gloss_before = film.sums(tile, GLINT_PASS_COMBINED) + number * tile.stride();
  const double* const rest_before = gloss_before + tile.stride();
  const auto largest = [](const Columns& sums, size_t k) {
    return std::max({std::fabs(sums[0][k]), std::fabs(sums[1][k]), std::fabs(sums[2][k])});
  };
  std::vector<double> shown(size());
  for (size_t k = 0; k < size(); ++k) {
    const double gloss = largest(gloss_, k), rest = largest(sums_, k);
    sums_[number][k] = gloss;
    sums_[number + 1][k] = rest;
    const double times = thrown_[k] / kStrong, strong = std::max(1.0, times * times),
                 own = kOwn * gloss / (first_ + 1.0) + kTimesBefore * gloss_before[slot(k)],
                 sum = kTimesRest * (rest_before[slot(k)] + rest) + strong * own,
                 most = sum / std::min(first_ + 1, kSettled);
    shown[k] = gloss > most ? most / gloss : 1;
  }
  for (size_t c = 0; c < number; ++c)
    for (size_t k = 0; k < size(); ++k) sums_[c][k] += shown[k] * gloss_[c][k];
}

template <size_t Count>
void Paths::place_samples(const SlotTable& places, const WindowPoints& points) {
  double *u = u_.data(), *v = v_.data();
  for (uint32_t slot : slots_) {
    u = std::copy_n(points.u(size_t(places.columns()[slot])), Count, u);
    v = std::copy_n(points.v(size_t(places.rows()[slot])), Count, v);
  }
}

/// Column by column, what a table of the camera has of each path.
template <size_t Count>
void Paths::place_rows(const SlotTable& places, const WindowPoints& points, const double* table,
                       std::vector<double>* to, size_t width) const {
  size_t k = 0;
  for (uint32_t slot : slots_) {
    const double* from = table + width * points.camera_row(size_t(places.columns()[slot]),
                                                           size_t(places.rows()[slot]));
    for (size_t s = 0; s < Count; ++s, ++k)
      for (size_t c = 0; c < width; ++c) to[c][k] = *from++;
  }
}

/// Each pixel's samples to its sum, in their order.
template <size_t Count>
void Paths::add_column(double* to, const double* from) const {
  for (uint32_t slot : slots_) {
    double sum = to[slot];
    for (size_t s = 0; s < Count; ++s) sum += *from++;
    to[slot] = sum;
  }
}

/// The same for a channel of colour or lost alpha, with how far the samples lie apart.
template <size_t Count>
void Paths::add_noted(double* to, const double* from, const Refinement::Ranges& ranges) const {
  for (uint32_t slot : slots_) {
    Accumulator accumulator{to[slot], ranges[slot]};
    for (size_t s = 0; s < Count; ++s) accumulator.add(*from++, first_ + s == 0);
    to[slot] = accumulator.sum;
    ranges.set(slot, accumulator.range);
  }
}

void Paths::add_to(Film& film, const Tile& tile, const Stages& stages) {
  double* const sums = film.sums(tile, GLINT_PASS_COMBINED);
  const size_t noted = film.refinement().on() ? 4 : 0;
  uint8_t* const soft_light = film.refinement().soft_light(tile, first_);
  for (size_t k = 0; soft_light && k < size(); ++k) soft_light[slot(k)] |= soft_light_[k];
  film.note_half(tile, slots_, first_);
  for (size_t c = 0; c < columns_; ++c) {
    double* const to = sums + c * tile.stride();
    if (c < noted)
      with_constant(1u << shift_, [&](auto count) {
        add_noted<count>(to, sums_[c], film.refinement().ranges(tile, c));
      });
    else if (is_whole(tile)) stages.add(to, sums_[c], size());
    else with_constant(1u << shift_, [&](auto count) { add_column<count>(to, sums_[c]); });
  }
}

void Paths::add_alone(const Film& film, double* sums, size_t stride) const {
  for (const uint32_t c : film.columns_of_rays())
    with_constant(1u << shift_,
                  [&](auto count) { add_column<count>(sums + c * stride, sums_[c]); });
}

void Paths::spread(Film& film, const Tile& tile, const std::vector<uint32_t>& slots,
                   uint32_t samples) const {
  const size_t noted = film.refinement().on() ? 4 : 0;
  double* to = film.sums(tile, GLINT_PASS_COMBINED);
  for (size_t c = 0; c < columns_; ++c, to += tile.stride()) {
    const Refinement::Ranges ranges =
        c < noted ? film.refinement().ranges(tile, c) : Refinement::Ranges{};
    Accumulator accumulator{to[slots[0]], c < noted ? ranges[slots[0]] : Between{}};
    for (uint32_t s = 0; s < samples; ++s) accumulator.add(sums_[c][0], first_ + s == 0);
    for (uint32_t slot : slots) {
      to[slot] = accumulator.sum;
      if (c < noted) ranges.set(slot, accumulator.range);
    }
  }
}

}  // namespace glint
