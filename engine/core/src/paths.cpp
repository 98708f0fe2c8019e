#include "paths.h"

namespace glint {

void Paths::choose(const Film& film, const SlotTable& places, const uint32_t* begin, const uint32_t* end, const RenderPlan& plan,
                   uint32_t first, uint32_t count) {
  slots_.assign(begin, end);
  first_ = first, shift_ = uint32_t(__builtin_ctz(count));
  for (std::vector<double>* v : {&column_, &row_, &dx_, &dy_}) v->resize((size() + kPad - 1) / kPad * kPad);
  double *x = column_.data(), *y = row_.data();
  for (uint32_t slot : slots_) x = std::fill_n(x, count, places.columns()[slot]), y = std::fill_n(y, count, places.rows()[slot]);
  place_samples(plan);
  if (columns_ != film.columns()) sums_ = Columns(columns_ = film.columns());
  sums_.reserve(kMost), softly_lit_.assign(size(), 0);
  for (size_t c = 0; c < columns_; ++c) std::fill_n(sums_[c], size(), 0.0);
}

void Paths::place_samples(const RenderPlan& plan) {
  const double* offset = plan.pixel_offsets + 2 * size_t(first_);
  const size_t last = (size_t(1) << shift_) - 1;
  for (size_t k = 0; k < size(); ++k) dx_[k] = offset[2 * (k & last)], dy_[k] = offset[2 * (k & last) + 1];
}

/// Each pixel's samples to its sum, in their order.
void Paths::add_column(double* to, const double* from) const {
  for (uint32_t slot : slots_) {
    double sum = to[slot];
    for (size_t s = 0; s >> shift_ == 0; ++s) sum += *from++;
    to[slot] = sum;
  }
}

/// Colour and lost alpha, with how far the samples lie apart.
void Paths::add_noted(Film& film, const Tile& tile) {
  double* const sums = film.sums(tile, GLINT_PASS_COMBINED);
  const size_t stride = tile.stride(), count = size_t(1) << shift_;
  before_.resize(4 * stride);
  for (size_t s = 0; s < count; ++s) {
    for (size_t c = 0; c < 4; ++c) {
      const double* from = sums_[c] + s;
      for (uint32_t slot : slots_) {
        double& sum = sums[c * stride + slot];
        before_[c * stride + slot] = sum, sum += *from, from += count;
      }
    }
    film.refinement().note(tile, slots_, before_.data(), sums, stride, first_ + s == 0);
  }
}

void Paths::add_to(Film& film, const Tile& tile, const Stages& stages) {
  double* const sums = film.sums(tile, GLINT_PASS_COMBINED);
  const bool noted = film.refinement().on();
  if (noted) add_noted(film, tile);
  uint8_t* const softly_lit = film.refinement().softly_lit(tile, first_);
  for (size_t k = 0; softly_lit && k < size(); ++k) softly_lit[slot(k)] |= softly_lit_[k];
  for (size_t c = noted ? 4 : 0; c < columns_; ++c) {
    double* const to = sums + c * tile.stride();
    if (is_whole(tile)) stages.add(to, sums_[c], size());
    else add_column(to, sums_[c]);
  }
}

}  // namespace glint
