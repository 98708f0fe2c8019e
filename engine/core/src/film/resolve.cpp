#include "film/resolve.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <optional>

#include "film/guide_fits.h"

namespace glint {
namespace {

constexpr float kAlike = 0.9f;  // cosine between normals of which nothing is shared any more
constexpr float kFlat = 0.04f;  // the same of the way between points along one's normal, squared

// Two estimates of one variance, each of the 25 pixels of a block, differ by more in one of twenty
// cases by chance (the quantile of Fisher's F for 24 and 24 degrees of freedom); of the 81 of a
// wide one, of which one is of what a fit leaves, for 73 and 80. Those of the 16 classes differ by
// more than kSurer in one of a thousand, for 15 and 15.
constexpr float kSure = 1.98f, kSureFit = 1.46f, kSurer = 5.54f;

// Colours, what is seen beside them and unit normals that differ by no more look the same.
constexpr float kEven = 1.0f / 50;

using Floats = std::vector<float>;

/// Pixels of a window, row by row.
struct Span {
  size_t first, width, height, stride;
  size_t count() const { return width * height; }
  /// Of the window, the pixel of that number.
  size_t pixel(size_t number) const { return first + number / width * stride + number % width; }
  /// body(number in the span, pixel of the window) for the first pixel of each row.
  template <class Body>
  void rows(Body body) const {
    for (size_t y = 0; y < height; ++y) body(y * width, first + y * stride);
  }
  ptrdiff_t offset(int x, int y) const { return ptrdiff_t(y) * ptrdiff_t(stride) + x; }
};

/// The pixels but for `rim` at each end.
Span inside(const ResolveWindow& window, size_t rim) {
  return {rim * window.width + rim, window.width - 2 * rim, window.height - 2 * rim, window.width};
}

/// The columns of a window that tell surfaces of a set, from one pixel on.
struct Surfaces {
  const float *normal[3], *place[3], *low[3], *surface;
  Surfaces(const ResolveWindow& window, GuideSet set, size_t pixel) {
    const auto column = [&](int number) { return window.guide(set, number) + pixel; };
    surface = column(ResolveWindow::kSurface);
    for (int c = 0; c < 3; ++c) {
      normal[c] = column(ResolveWindow::kNormal + c);
      place[c] = column(ResolveWindow::kPlace + c);
      low[c] = column(ResolveWindow::kPlaceLow + c);
    }
  }
};

/// Of `count` pixels in a row; without a branch, so that several are weighed at once.
void weigh_row(const Surfaces& p, const Surfaces& q, size_t count, float* __restrict weights) {
  for (size_t i = 0; i < count; ++i) {
    const auto off_by = [&](int c) {
      return (q.place[c][i] - p.place[c][i]) + (q.low[c][i] - p.low[c][i]);
    };
    const float px = p.normal[0][i], py = p.normal[1][i], pz = p.normal[2][i], qx = q.normal[0][i],
                qy = q.normal[1][i], qz = q.normal[2][i], dx = off_by(0), dy = off_by(1),
                dz = off_by(2), cosine = px * qx + py * qy + pz * qz,
                along = dx * px + dy * py + dz * pz, beside = dx * qx + dy * qy + dz * qz,
                square = dx * dx + dy * dy + dz * dz,
                level = (cosine - kAlike) * (1 / (1 - kAlike)), above = level < 0 ? 0 : level,
                alike = above > 1 ? 1 : above, along2 = along * along, beside2 = beside * beside,
                off = along2 < beside2 ? beside2 : along2, most = kFlat * square,
                part = (most - off) / (most > off ? most : 1), same = square > 0 ? 0.0f : 1.0f,
                flat = most > off ? part : same;
    weights[i] = alike * flat * p.surface[i] * q.surface[i];
  }
}

/// How surely the pixel `to` away from each of the span shows the same surface, 0 to 1.
void weigh(const ResolveWindow& window, GuideSet set, const Span& span, ptrdiff_t to,
           float* weights) {
  span.rows([&](size_t out, size_t at) {
    weigh_row({window, set, at}, {window, set, size_t(ptrdiff_t(at) + to)}, span.width,
              weights + out);
  });
}

/// sum += weight value, the latter of the pixels `to` away.
void add(const Span& span, ptrdiff_t to, const float* weights, const float* values, float* sum) {
  span.rows([&](size_t out, size_t at) {
    const float* const from = values + (ptrdiff_t(at) + to);
    for (size_t i = 0; i < span.width; ++i) sum[out + i] += weights[out + i] * from[i];
  });
}

/// The weights of the pixels of a block round each of the span, one after the other.
struct Block {
  std::vector<ptrdiff_t> to;
  Floats weights;
  Block(const Span& span, int reach) {
    for (int j = -reach; j <= reach; ++j)
      for (int i = -reach; i <= reach; ++i) {
        to.push_back(span.offset(i, j));
        const float share =
            (std::abs(i) == reach ? 0.5f : 1.0f) * (std::abs(j) == reach ? 0.5f : 1.0f);
        weights.insert(weights.end(), span.count(), share);
      }
  }
  /// The same, of which those alone weigh that show the same surface.
  Block alike(const ResolveWindow& window, GuideSet set, const Span& span) const {
    Block found = *this;
    Floats alike(span.count());
    for (size_t k = 0; k < to.size(); ++k) {
      weigh(window, set, span, to[k], alike.data());
      for (size_t i = 0; i < span.count(); ++i) found.weights[k * span.count() + i] *= alike[i];
    }
    return found;
  }
  const float* of(size_t k) const { return weights.data() + k * (weights.size() / to.size()); }
};

/// How far each pixel of the span is from the mean of those a block to either side of it, on the
/// axis on which it is farther; below 0 where none of these shows the same surface.
class Changes {
 public:
  Changes(const ResolveWindow& window, GuideSet set, const Span& span, int side)
      : span_(span), pixels_(window.pixels()) {
    for (size_t axis = 0; axis < 2; ++axis) {
      to_[axis] = axis == 0 ? span.offset(side, 0) : span.offset(0, side);
      for (size_t k = 0; k < 2; ++k) {
        same_[axis][k].resize(span.count());
        weigh(window, set, span, k == 0 ? to_[axis] : -to_[axis], same_[axis][k].data());
      }
    }
  }

  void of(const float* values, Floats& found) const {
    found.assign(pixels_, -1.0f);
    for (size_t axis = 0; axis < 2; ++axis) {
      const float *const after = same_[axis][0].data(), *const before = same_[axis][1].data();
      span_.rows([&](size_t out, size_t at) {
        const float* const here = values + at;
        const float* const next = here + to_[axis];
        const float* const last = here - to_[axis];
        for (size_t i = 0; i < span_.width; ++i) {
          const float a = after[out + i], b = before[out + i], sum = a + b,
                      mean = (a * next[i] + b * last[i]) / (sum > 0 ? sum : 1),
                      off = sum > 0 ? std::fabs(here[i] - mean) : -1;
          found[at + i] = std::max(found[at + i], off);
        }
      });
    }
  }

 private:
  Span span_;
  size_t pixels_;
  ptrdiff_t to_[2] = {};
  Floats same_[2][2];
};

/// Of the region, the pixel of that number of the span.
uint32_t pixel_of(const Span& span, size_t number, uint32_t x0, uint32_t y0, uint32_t width) {
  return (y0 + uint32_t(number / span.width)) * width + x0 + uint32_t(number % span.width);
}

float over(float a, float b) { return b > 0 ? a / b : 0; }

/// Whether light is averaged over blocks of twice the side, as bounces are dealt.
constexpr bool is_wide(int light) { return light == kDiffuseIndirect || light == kVolumeIndirect; }

/// One kind of light of a window, and what the pixels of a span take of their blocks.
class LightResolve {
 public:
  LightResolve(const ResolveWindow& window, const ResolveWindow* finer, const Span& span,
               uint32_t side)
      : window_(window),
        finer_(finer),
        span_(span),
        side_(side),
        tint_(window.pixels()),
        white_(window.pixels()),
        weight_(window.pixels()) {}

  /// False where there is none. is_halved: halves of samples tell how far its means are off. block:
  /// of pixels that show the same surface.
  bool choose(int light, bool is_halved, const Block& block) {
    const float* const all = window_.column(ResolveWindow::kLight + 3 * light);
    if (std::all_of(all, all + 3 * window_.pixels(), [](float own) { return own == 0; }))
      return false;
    if (told_over(light) != kind_of(light))
      find_unshadowed(told_over(light), kind_of(light), is_halved, block);
    set_light(all, told_over(light), kind_of(light));
    set_ = guides_of(light);
    is_halved_ = is_halved;
    is_wide_ = is_wide(light);
    set_sharp(light);
    if (set_ != kSeen) find_covered();
    const std::span<const int> together = looked_at(light);
    is_spread_known_ = looked_at_ == together.front();
    looked_at_ = together.front();
    if (is_spread_known_) return true;
    std::vector<const float*> seen;
    for (const int part : together)
      seen.push_back(window_.column(ResolveWindow::kLight + 3 * part));
    set_seen(seen, ResolveWindow::kNoise + together.front());
    return true;
  }

  /// What lights would give if nothing hid them, which light of them is told over: of pixels of the
  /// span as all their camera rays say, but for what is noise, of more rays than samples so much
  /// less. In its place is the mean of the block, over the colour of surfaces. kind: which of the
  /// unshadowed ones; surface_kind: of what colour.
  void find_unshadowed(int kind, int surface_kind, bool is_halved, const Block& block) {
    const int number = kind - kUnshadowedMatt;
    set_light(window_.column(ResolveWindow::kColor + 3 * kind), surface_kind, surface_kind);
    set_ = kSeen;
    is_halved_ = is_halved;
    is_wide_ = false;
    looked_at_ = -1;
    is_spread_known_ = false;
    set_seen({&light_[0], 1}, ResolveWindow::kUnshadowedNoise + number);
    find_means(block);
    is_known_finely_ = true;
    find_spread(block);
    is_known_finely_ = false;
    for (Floats& found : unshadowed_[number]) found.resize(span_.count());
    for (size_t k = 0; k < span_.count(); ++k) {
      const float taken = is_alone(block, k) ? 0 : averaged(k, sure_[k]);
      for (int c = 0; c < 3; ++c) {
        const float whole = own(ResolveWindow::kColor + 3 * kind + c, k),
                    given = taken * fine_[c][k] + (1 - taken) * whole;
        unshadowed_[number][c][k] = std::isfinite(given) ? given : whole;
      }
    }
  }

  void find_means(const Block& block) {
    for (int c = 0; c < 3; ++c) {
      light_sum_[c].assign(span_.count(), 0.0f);
      color_sum_[c].assign(span_.count(), 0.0f);
      for (size_t k = 0; k < block.to.size(); ++k) {
        add(span_, block.to[k], block.of(k), light_[c], light_sum_[c].data());
        add(span_, block.to[k], block.of(k), color_[c], color_sum_[c].data());
      }
    }
    if (!is_spread_known_) find_mean(block);
    for (int c = 0; c < 3; ++c) {
      coarse_[c].resize(span_.count());
      fine_[c].resize(span_.count());
      for (size_t k = 0; k < span_.count(); ++k) {
        const float ratio = over(light_sum_[c][k], color_sum_[c][k]);
        coarse_[c][k] = ratio * color_[c][span_.pixel(k)];
        fine_[c][k] = ratio * own_color(k, c);
      }
    }
  }

  /// What is looked at of blocks, over the colour of their surfaces.
  void find_mean(const Block& block) {
    for (Floats* sums : {&mean_, &tint_sum_}) sums->assign(span_.count(), 0.0f);
    for (size_t k = 0; k < block.to.size(); ++k) {
      add(span_, block.to[k], block.of(k), seen_.data(), mean_.data());
      add(span_, block.to[k], block.of(k), tint_.data(), tint_sum_.data());
    }
    for (size_t i = 0; i < span_.count(); ++i) mean_[i] = over(mean_[i], tint_sum_[i]);
  }

  /// Of pixels to which fewer of their block are alike than guides may tell apart of the `whole`
  /// one, as those where surfaces meet: means that change over that as the guides do.
  void fit_edges(const Block& block, const Block& whole) {
    float most = 0;
    for (size_t j = 0; j < whole.to.size(); ++j) most += whole.of(j)[0];
    for (size_t k = 0; k < span_.count(); ++k) {
      float alike = 0;
      for (size_t j = 0; j < block.to.size(); ++j) alike += block.of(j)[k];
      const float tint = own_tint(k);
      if (own_guide(ResolveWindow::kSurface, k) > 0 && tint > 0 && kGuides * alike < most)
        fit_edge(whole, k, tint);
    }
  }

  /// How far pixels of the blocks lie apart, and how much of that is seen or is noise; all over the
  /// mean, so that no square leaves the range of floats.
  void find_spread(const Block& block) {
    if (is_spread_known_) return;
    find_change();
    for (Floats* sums : {&apart_, &changed_, &noise_}) sums->assign(span_.count(), 0.0f);
    for (size_t k = 0; k < block.to.size(); ++k)
      span_.rows([&](size_t out, size_t at) {
        add_spread(out, size_t(ptrdiff_t(at) + block.to[k]), block.of(k));
      });
    sure_.resize(span_.count());
    for (size_t k = 0; k < span_.count(); ++k) {
      sure_[k] = is_halved_ ? std::max(apart_[k] - kSure * noise_share(k) * noise_[k], 0.0f) : 0;
      const float seen = std::max(changed_[k], apart_[k] - kSurer * noise_[k]);
      if (!is_wide_ && seen < sure_[k])
        sure_[k] = std::min(sure_[k], std::max(seen, apart_[k] - kSure * along_lines(block, k)));
    }
  }

  /// What pixel k of the span, q of the window, gets in a channel.
  float given(size_t k, size_t q, int c) const {
    const float sharp = sharp_[q],
                stays = sharp > 0 ? sharp * apart_[k] + (1 - sharp) * sure_[k] : sure_[k],
                taken = averaged(k, stays), light = light_[c][q], coarse = coarse_[c][k],
                fine = fine_[c][k],
                stayed = coarse > fine ? light * (fine / coarse) : light + (fine - coarse),
                more = taken * fine + (1 - taken) * stayed - light;
    return color_sum_[c][k] > 0 && std::isfinite(more) ? more : 0;
  }

 private:
  /// Whether light is told over what lights give that nothing hides, which is better known than of
  /// the samples.
  bool is_unshadowed() const { return kind_ >= kUnshadowedMatt && kind_ < kColoredKinds; }
  /// Whether no other pixel of the block of pixel k of the span shows what it does.
  bool is_alone(const Block& block, size_t k) const {
    for (size_t j = 0; j < block.to.size(); ++j)
      if (block.to[j] != 0 && block.of(j)[k] > 0 &&
          tint_[size_t(ptrdiff_t(span_.pixel(k)) + block.to[j])] > 0)
        return false;
    return true;
  }
  /// How much of pixel k of the span is averaged where so much of its spread stays.
  float averaged(size_t k, float stays) const {
    return apart_[k] > stays ? 1 - stays / apart_[k] : 0;
  }
  /// How much of the noise of its samples more rays of pixel k of the span leave of what they tell.
  float noise_share(size_t k) const {
    return is_known_finely_ && finer_ ? finer_->column(ResolveWindow::kSampleShare)[k] : 1;
  }
  float at(int column, size_t q) const { return window_.column(column)[q]; }
  float guide(int number, size_t q) const { return window_.guide(set_, number)[q]; }

  /// Of pixel k of the span, as well as it is known.
  float own(int column, size_t k) const {
    return finer_ ? finer_->column(column)[k] : at(column, span_.pixel(k));
  }
  float own_guide(int number, size_t k) const {
    if (set_ == kSeen) return own(number, k);
    const bool is_share = number == ResolveWindow::kShare || number == ResolveWindow::kAlong;
    return guide(number, span_.pixel(k)) * (is_share ? covered_[k] : 1);
  }
  float own_color(size_t k, int c) const {
    if (is_unshadowed()) return unshadowed_[kind_ - kUnshadowedMatt][c][k];
    if (set_ == kSeen) return own(ResolveWindow::kColor + 3 * kind_ + c, k);
    return color_[c][span_.pixel(k)] * covered_[k];
  }

  /// The channels of the colour of surfaces.
  float own_tint(size_t k) const {
    if (!is_unshadowed()) return own_color(k, 0) + own_color(k, 1) + own_color(k, 2);
    const int first = ResolveWindow::kColor + 3 * surface_kind_;
    return own(first, k) + own(first + 1, k) + own(first + 2, k);
  }

  /// How many times what samples say of them mirrors or glass take of each pixel of the span: what
  /// these show is known of samples alone.
  void find_covered() {
    const int kind = set_ == kInMirrors ? kGlossyColor : kTransmissionColor,
              first = ResolveWindow::kColor + 3 * kind;
    covered_.assign(span_.count(), 1);
    for (size_t k = 0; finer_ && k < span_.count(); ++k) {
      const size_t q = span_.pixel(k);
      covered_[k] = over(own(first, k) + own(first + 1, k) + own(first + 2, k),
                         at(first, q) + at(first + 1, q) + at(first + 2, q));
    }
  }

  /// Of a pixel q of the window, but for the colour, less those of pixel k of the span as far as
  /// surfaces are seen.
  GuideFits::Guides guides(size_t k, size_t q) const {
    const auto get = [&](int number) { return double(guide(number, q)); };
    const auto here = [&](int number) { return double(own_guide(number, k)); };
    const double share = get(ResolveWindow::kShare),
                 part = share * here(ResolveWindow::kAlong) / here(ResolveWindow::kShare);
    GuideFits::Guides found{share};
    for (int c = 0; c < 3; ++c) {
      const int normal = ResolveWindow::kNormal + c, place = ResolveWindow::kPlace + c,
                low = ResolveWindow::kPlaceLow + c;
      found[size_t(1 + c)] = get(ResolveWindow::kAlong) * get(normal) - part * here(normal);
      found[size_t(4 + c)] = share * (get(place) - here(place) + (get(low) - here(low)));
    }
    return found;
  }

  /// Sets what pixel k of the span gets, whose colour is that bright, and how far its block is from
  /// that.
  void fit_edge(const Block& block, size_t k, float own_tint) {
    const size_t p = span_.pixel(k);
    near_.clear();
    double all = 0, far = 0, tinted = 0, colored = 0;
    for (size_t j = 0; j < block.to.size(); ++j) {
      const size_t q = size_t(ptrdiff_t(p) + block.to[j]);
      if (!(guide(ResolveWindow::kSurface, q) > 0)) continue;
      const Near& near = near_.emplace_back(Near{q, double(block.of(j)[k]), guides(k, q)});
      const GuideFits::Guides& g = near.guides;
      all += near.weight * g[0] * g[0];
      far += near.weight * (g[4] * g[4] + g[5] * g[5] + g[6] * g[6]);
      const double color = double(color_[0][q] + color_[1][q] + color_[2][q]);
      tinted += near.weight * double(tint_[q]) * double(tint_[q]);
      colored += near.weight * color * color;
    }
    const double scale = far > 0 ? std::sqrt(all / far) : 0,
                 share = double(own_guide(ResolveWindow::kShare, k)),
                 full_color = std::sqrt(all / colored);
    const Four here(own_color(k, 0), own_color(k, 1), own_color(k, 2), own_tint),
        full(full_color, full_color, full_color, std::sqrt(all / tinted));
    const auto color_of = [&](const GuideFits::Guides& g, size_t q) {
      return full *
             (Four(color_[0][q], color_[1][q], color_[2][q], tint_[q]) - g[0] / share * here);
    };
    const auto bright = [&](size_t q) { return double(white_[q]) * double(tint_[q]); };
    GuideFits fits;
    double most[3] = {};
    for (auto& [q, weight, g] : near_) {
      for (size_t i = 4; i < 7; ++i) g[i] *= scale;
      for (int c = 0; c < 3; ++c) most[c] = std::max(most[c], double(light_[c][q]));
      fits.add(weight, g, color_of(g, q), {light_[0][q], light_[1][q], light_[2][q], bright(q)});
    }
    fits.solve();
    double apart = 0, noise = 0;
    for (const auto& [q, weight, g] : near_) {
      const double half = double(halves_[q]) * double(tint_[q]),
                   off = bright(q) - fits.at(g, color_of(g, q))[3];
      apart += weight * off * off;
      noise += weight * half * half;
    }
    apart_[k] = changed_[k] = 1;  // images stay
    // what has no spread stays, of one sample nothing does
    const double left =
        apart > 0 && std::isfinite(apart) ? 1 - double(kSureFit) * noise / apart : 1;
    sure_[k] = is_halved_ ? float(std::max(left, 0.0)) : 0;
    const auto held = [&](double light, int c) { return float(std::clamp(light, 0.0, most[c])); };
    for (int c = 0; c < 3; ++c) {
      fine_[c][k] = coarse_[c][k] = held(share * fits.here()[c], c);
      color_sum_[c][k] = own_color(k, c);
    }
    if (!finer_ && !is_unshadowed()) return;
    GuideFits::Guides coarse{};
    if (guide(ResolveWindow::kSurface, p) > 0) coarse = guides(k, p);
    for (size_t i = 4; i < 7; ++i) coarse[i] *= scale;
    const Four light = fits.at(coarse, color_of(coarse, p));
    for (int c = 0; c < 3; ++c) coarse_[c][k] = held(light[c], c);
  }

  /// How far light changes with a step in the direction in which that is least, round pixel k of
  /// the span: as `apart_` where it has no direction, next to nothing along stripes.
  float along_lines(const Block& block, size_t k) const {
    const float inverse = over(1, mean_[k]);
    float least = HUGE_VALF;
    for (const auto& [x, y] : {std::pair{1, 0}, {0, 1}, {1, 1}, {1, -1}}) {
      float sum = 0, known = 0, all = 0;
      for (size_t j = 0; j < block.to.size(); ++j) {
        const size_t q = size_t(ptrdiff_t(span_.pixel(k)) + block.to[j]),
                     next = size_t(ptrdiff_t(q) + span_.offset(x, y));
        const float weight = block.of(j)[k] * weight_[q],
                    off = (white_[q] - white_[next]) * inverse;
        all += weight;
        if (!(tint_[next] > 0)) continue;
        known += weight;
        sum += weight * off * off / 2;
      }
      if (known > 0) least = std::min(least, sum * (all / known));
    }
    return least;
  }

  /// The light of pixels, what it is told over, and the surfaces over whose colour it is looked at.
  void set_light(const float* light, int kind, int surface_kind) {
    kind_ = kind;
    surface_kind_ = surface_kind;
    for (size_t c = 0; c < 3; ++c) {
      light_[c] = light + c * window_.pixels();
      color_[c] = window_.column(ResolveWindow::kColor + 3 * kind + int(c));
    }
    const float* const surface = window_.column(ResolveWindow::kColor + 3 * surface_kind);
    float most = 0;
    for (size_t i = 0; i < window_.pixels(); ++i) {
      tint_[i] = 0;
      for (size_t c = 0; c < 3; ++c) tint_[i] += surface[c * window_.pixels() + i];
      if (std::isfinite(tint_[i])) most = std::max(most, tint_[i]);
    }
    const float scale = most > 0 ? std::ldexp(1.0f, -std::clamp(std::ilogb(most), -126, 126)) : 1;
    for (size_t i = 0; i < window_.pixels(); ++i) {
      const float scaled = tint_[i] * scale;
      weight_[i] = scaled * scaled;
    }
  }

  /// What is looked at of pixels: the channels of these lights; noise: the column that tells how
  /// far their means are off.
  void set_seen(std::span<const float* const> lights, int noise) {
    halves_.assign(window_.column(noise), window_.column(noise) + window_.pixels());
    seen_.assign(window_.pixels(), 0.0f);
    for (const float* own : lights)
      for (size_t i = 0, n = window_.pixels(); i < n; ++i)
        seen_[i] += own[i] + own[n + i] + own[2 * n + i];
    for (size_t i = 0; i < window_.pixels(); ++i) white_[i] = over(seen_[i], tint_[i]);
  }

  /// How much of the light of pixels is of sharp images: what of it mirrors and clear glass show.
  void set_sharp(int light) {
    const int number = kind_of(light) - kFirstSharp;
    sharp_.assign(window_.pixels(), 0.0f);
    if (number >= 0 && number < kSharpKinds) {
      const float* const own = window_.column(ResolveWindow::kSharp + number);
      std::copy_n(own, window_.pixels(), sharp_.begin());
    }
  }

  /// What does not repeat from block to block; below 0, not known, where blocks are wider.
  void find_change() {
    if (is_wide_) return change_.assign(window_.pixels(), -1.0f);
    std::optional<Changes>& changes = changes_[set_];
    if (!changes) changes.emplace(window_, set_, inside(window_, side_), int(side_));
    changes->of(white_.data(), change_);
  }

  /// Of a row of the span, from its number `out` on, with the pixels from `first` on.
  void add_spread(size_t out, size_t first, const float* weights) {
    for (size_t i = 0; i < span_.width; ++i) {
      const size_t k = out + i, q = first + i;
      const float inverse = over(1, mean_[k]), off = (white_[q] - mean_[k]) * inverse,
                  half = halves_[q] * inverse, moved = change_[q] * inverse,
                  sure = is_halved_ ? std::max(off * off - kSure * half * half, 0.0f) : 0,
                  weight = weights[k] * weight_[q];
      apart_[k] += weight * off * off;
      changed_[k] += weight * (moved < 0 ? sure : moved * moved);
      noise_[k] += weight * half * half;
    }
  }

  const ResolveWindow& window_;
  const ResolveWindow* const finer_;  // of the span alone; null for none
  const Span span_;
  const uint32_t side_;
  std::optional<Changes> changes_[kGuideSets];
  const float *light_[3] = {}, *color_[3] = {};
  int kind_ = 0, surface_kind_ = 0;
  GuideSet set_ = kSeen;
  int looked_at_ = -1;  // the first of the lights that spreads are of
  bool is_halved_ = false, is_wide_ = false, is_known_finely_ = false, is_spread_known_ = false;
  struct Near {
    size_t pixel;  // of the window
    double weight;
    GuideFits::Guides guides;
  };
  std::vector<Near> near_;                       // of the block of one pixel
  Floats covered_;                               // of the span
  Floats tint_, seen_, white_, halves_, sharp_;  // of the window; white_: seen_ over its colour
  Floats weight_;  // the same: tint_ squared, times a power of two, as squares may be beyond floats
  Floats unshadowed_[2][3];  // of the span, channels by kind
  Floats change_, light_sum_[3], color_sum_[3], tint_sum_, mean_, apart_, changed_, noise_, sure_;
  Floats coarse_[3],
      fine_[3];  // of the span: predictions of its samples' light, and of all its rays'
};

/// Whether pixels of two rows, from p and from q on, differ in a value by more than looks the same
/// where they are that bright, or did before.
void differ(const float* value, const float* bright, size_t p, size_t q,
            std::vector<uint8_t>& apart) {
  for (size_t k = 0; k < apart.size(); ++k) {
    const float whole = std::max(bright[p + k], bright[q + k]);
    apart[k] |= std::fabs(value[p + k] - value[q + k]) > kEven * whole;
  }
}

/// What pixel q gets whose catchers get that much more of light: their shadows are as dark as what
/// they have then says, where the samples' were so by their own ratios, each of a few points.
void show_caught(const ResolveWindow& window, size_t q, bool is_grey, float (&given)[3]) {
  double left[3];
  const auto value = [&](int column, int c) { return double(window.column(column + c)[q]); };
  for (int c = 0; c < 3; ++c)
    left[c] = caught_ratio(value(ResolveWindow::kLight + 3 * kCaught, c) + double(given[c]),
                           value(ResolveWindow::kColor + 3 * kind_of(kCaught), c));
  const double light = std::clamp((left[0] + left[1] + left[2]) / 3, 0.0, 1.0);
  for (int c = 0; c < 3; ++c)
    given[c] = float(value(ResolveWindow::kUnshadedColor, c) * ((is_grey ? light : left[c]) - 1) -
                     value(ResolveWindow::kShadow, c));
}

}  // namespace

Resolve::Resolve(uint32_t side, Region region, uint32_t kept, Catches catches)
    : side_(side), width_(region.width()), catches_(catches) {
  const size_t pixels = size_t(region.width()) * region.height();
  added_ = ZeroedBuffer<float>(4 * pixels);
  for (int light = 0; light < kResolvedLights + kGlows; ++light)
    if (kept >> light & 1) lights_[light] = ZeroedBuffer<float>(3 * pixels);
}

std::vector<uint8_t> Resolve::uneven(const ResolveWindow& window) const {
  const Span span = inside(window, looks_at());
  std::vector<uint8_t> found(span.count(), 0), apart(span.width);
  Floats alike(span.count());
  // what may differ, and how bright of which the differences are
  std::vector<std::pair<const float*, size_t>> values;
  std::vector<Floats> bright;
  const auto compare = [&](int column, int brightness) {
    Floats& most = bright.emplace_back(window.pixels(), 0.0f);
    for (int c = 0; c < 3; ++c) {
      const float* const own = window.column(brightness + c);
      for (size_t q = 0; q < most.size(); ++q) most[q] = std::max(most[q], std::fabs(own[q]));
      values.emplace_back(window.column(column + c), bright.size() - 1);
    }
  };
  for (int kind = 0; kind < kColoredKinds; ++kind)
    if (kind < kUnshadowedMatt && kind != kMirroredSurfaces && kind != kRefractedSurfaces)
      compare(ResolveWindow::kColor + 3 * kind, ResolveWindow::kColor + 3 * kind);
  compare(ResolveWindow::kRest, ResolveWindow::kWhole);
  bright.emplace_back(window.pixels(), 1.0f);
  values.emplace_back(window.column(ResolveWindow::kRest + 3), bright.size() - 1);
  const float* const surface = window.column(ResolveWindow::kSurface);
  const float* const in_picture = window.column(ResolveWindow::kInside);
  const float* const share = window.column(ResolveWindow::kShare);
  const float* const along = window.column(ResolveWindow::kAlong);
  span.rows([&](size_t out, size_t p) {
    for (size_t k = 0; k < span.width; ++k) {
      const float all = share[p + k], mean = along[p + k];  // shorter where normals differ
      found[out + k] = surface[p + k] > 0 && mean * mean < all * all * (1 - kEven * kEven);
    }
  });
  for (int j = -1; j <= 1; ++j)
    for (int i = -1; i <= 1; ++i) {
      const ptrdiff_t to = span.offset(i, j);
      weigh(window, kSeen, span, to, alike.data());
      span.rows([&](size_t out, size_t p) {
        const size_t q = size_t(ptrdiff_t(p) + to);
        for (size_t k = 0; k < span.width; ++k)
          apart[k] = alike[out + k] == 0 && surface[p + k] + surface[q + k] > 0;
        for (const auto& [value, of] : values) differ(value, bright[of].data(), p, q, apart);
        for (size_t k = 0; k < span.width; ++k)
          if (in_picture[q + k] != 0) found[out + k] |= apart[k];
      });
    }
  return found;
}

void Resolve::run(const ResolveWindow& window, const ResolveWindow* finer, uint32_t x0, uint32_t y0,
                  bool is_halved) {
  const Span span = inside(window, looks_at());
  const Block in_media(span, int(side_ / 2)), whole(span, int(side_));  // as bounces are dealt
  const Block on_surfaces = in_media.alike(window, kSeen, span),
              wide = whole.alike(window, kSeen, span);
  LightResolve one(window, finer, span, side_);
  for (size_t y = 0; y < span.height; ++y)
    std::fill_n(added_.data() + 4 * ((y0 + y) * width_ + x0), 4 * span.width, 0.0f);
  const auto add_light = [&](int light) {
    const bool any = one.choose(light, is_halved, on_surfaces),
               is_caught = light == kCaught && catches_ != Catches::kNone,
               is_lost = is_caught && catches_ == Catches::kAlpha,
               is_seen = is_caught ? catches_ == Catches::kColor : light != kOpen;
    const auto find = [&](const Block& block) {
      one.find_means(block);
      one.find_spread(block);
      if (light < kVolumeDirect) one.fit_edges(block, whole);
    };
    const bool on_surface = light < kVolumeDirect;
    if (any && guides_of(light) != kSeen) find(in_media.alike(window, guides_of(light), span));
    else if (any && is_wide(light)) find(on_surface ? wide : whole);
    else if (any) find(on_surface ? on_surfaces : in_media);
    float* const own = lights_[light].size() ? lights_[light].data() : nullptr;
    for (size_t k = 0; (any || own || is_caught) && k < span.count(); ++k) {
      const size_t pixel = pixel_of(span, k, x0, y0, width_), q = span.pixel(k);
      float* const sums = added_.data() + 4 * pixel;
      float given[3] = {};
      for (int c = 0; any && c < 3; ++c) given[c] = one.given(k, q, c);
      if (is_caught) show_caught(window, q, catches_ != Catches::kPass, given);
      for (int c = 0; c < 3; ++c) {
        if (is_seen) sums[c] += given[c];
        if (is_lost) sums[3] += given[c] / 3;
        if (own) own[3 * pixel + size_t(c)] = given[c];
      }
    }
  };
  for (int light = 0; light < kResolvedLights; ++light)  // spreads are found once for each group
    if (looked_at(light).front() == light)
      for (const int part : looked_at(light)) add_light(part);
  for (size_t k = 0; finer && k < span.count(); ++k) {
    const size_t pixel = pixel_of(span, k, x0, y0, width_);
    const auto more = [&](int column) {
      return finer->column(column)[k] - window.column(column)[span.pixel(k)];
    };
    for (int c = 0; c < 4; ++c)
      added_.data()[4 * pixel + size_t(c)] += more(ResolveWindow::kRest + c);
    for (int i = 0; i < 3 * kGlows; ++i)
      if (ZeroedBuffer<float>& own = lights_[kResolvedLights + i / 3]; own.size())
        own.data()[3 * pixel + size_t(i % 3)] = more(ResolveWindow::kGlow + i);
  }
}

}  // namespace glint
