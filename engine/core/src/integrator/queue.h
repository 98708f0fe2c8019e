// Rays on their way, with what each carries to its pixel, by component.
#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <vector>

#include "bvh/accel.h"
#include "integrator/columns.h"
#include "math/vec.h"
#include "shading/path_state.h"

namespace glint {

/// A ray of a queue by itself, of the depth and the slot that it has there; first what a camera ray
/// is.
struct Path : PathBits {
#define RAY_COLUMN(name, width, first, kept) Row<width> name = all_of<width>(first);
#include "shading/path_state.inc"

  /// The largest exponent of highlights that it meets: a power of two, that of the narrowest lobe
  /// of the roughest surface on its way.
  double widest() const { return width == 0 ? HUGE_VAL : std::ldexp(1.0, int(width) - 1); }
  void widen(double exponent) {
    if (const double most = std::min(widest(), exponent); most < HUGE_VAL)
      width = uint64_t(1 + std::clamp(std::ilogb(most), 0, 60)) & 63;
  }
  /// It leaves a point along a direction of its lobes.
  void leave(Vec3d point) {
    start = point;
    from = 0;
    straight = 0;
    wants_data = false;
    skyless = true;
  }
};

/// Rays that look for the same visibility: kCamera at depth 0, one of a path, else kMirror,
/// kDiffuse of gather rays, or kTransmission, where instances differ in these.
class Queue : public RayColumns {
 public:
  explicit Queue(uint32_t visibility_ = kMirror) : RayColumns{}, visibility(visibility_) {}
  Queue(Queue&&) = default;
  Queue& operator=(Queue&&) = default;

  size_t size() const { return size_; }
  void clear() {
    size_ = 0;
    hits_.clear();
  }
  /// Room for so many rays in all.
  void reserve(size_t count);
  void push(const Ray& ray, Path path);
  /// Of a queue of `exits`, with what the ray meets.
  void push(const Ray& ray, const Path& path, const Hit& hit) {
    push(ray, path);
    hits_.push_back(hit);
  }
  /// Adds ray k of another queue as it is; of this one where at most k rays are left in it.
  void append(const Queue& other, size_t k);
  /// Moves the rays whose last bounce was a refraction to another queue, in order.
  void give_refracted(Queue& to);
  /// Where a stage adds rays.
  RayEnd end() { return {*this, &size_}; }
  /// `count` rays from o = start = 0 with weight 1, but for what was written there after an earlier
  /// call; directions, bounds and who wants data are to be filled in. Nothing is ever pushed here.
  void start_at_camera(size_t count);

  Ray ray(size_t k) const { return {row(o, k), row(d, k), t_min[k], t_max[k], visibility}; }
  /// Ray k for what leaves its hit: that is no refraction yet, and has no AOVs of its own.
  Path path(size_t k) const {
    Path path{bits(k)};
    path.wants_aovs = path.refracted = 0;
#define RAY_COLUMN(name, width, first, kept) path.name = row(name, k);
#include "shading/path_state.inc"
    return path;
  }
  Vec3d weight(size_t k) const { return row(T, k); }
  PathBits bits(size_t k) const { return std::bit_cast<PathBits>(tags[k]); }
#define PATH_BITS(name, constant, count) \
  uint32_t name(size_t k) const { return uint32_t(bits(k).name); }
#include "shading/path_state.inc"
  /// One of the bits of what a ray wants.
  void want(size_t k, int bit) {
    tags[k] |= int64_t(1) << bit;
    numbered_ = 0;
  }
  Rays rays() const;

  uint32_t visibility;
  /// What happened before to all of its rays.
  struct Past {
    /// How often rough surfaces reflected them, or they bounced; from the first time on they see no
    /// lights: these have highlights there, and points of them in mirrors beyond would be dots.
    uint32_t reflections = 0;
    uint32_t bounced = 0;    // how often what is matt scattered them
    bool gathers = false;    // it did so last: they look for surfaces that throw light on
    bool in_medium = false;  // a medium was the first to scatter them
    /// They bring light to a catcher of shadows: with all things there, or as if catchers were the
    /// only ones.
    enum Caught : uint8_t { kSeen, kWithAll, kAlone } caught = kSeen;

    /// After one more reflection by a rough surface.
    Past reflected() const {
      Past past = *this;
      ++past.reflections;
      return past;
    }
    /// After what is matt scattered them.
    Past scattered() const {
      Past past = reflected();
      ++past.bounced;
      past.gathers = true;
      return past;
    }
  } past;
  bool gathers() const { return past.gathers; }
  /// Whether rough surfaces reflected them.
  bool is_gloss() const { return past.reflections > past.bounced; }
  bool sees_blurred() const { return past.reflections > 0; }
  /// What they meet is known: where light comes out again that went below a surface, which gives
  /// back all of it there.
  bool exits = false;
  const Hit& hit(size_t k) const { return hits_[k]; }

 private:
#define RAY_COLUMN(name, width, first, kept) +width
  Columns columns_{0
#include "shading/path_state.inc"
  };
  std::vector<int64_t> tags_;       // RayTag
  std::vector<Hit> hits_;           // of exits
  size_t size_ = 0, numbered_ = 0;  // numbered_: tags that are but their number
};

/// Cuts lists of a queue's rays where a path comes again.
class PathCuts {
 public:
  /// How many of the rays, from the first on, are of different paths.
  size_t leading(const Queue& queue, const uint32_t* rows, size_t count);

 private:
  std::vector<uint32_t> seen_;  // by slot, the list where it was seen last
  uint32_t list_ = 0;
};

/// Cuts a queue into pieces of at most `limit` rays, in order. All rays of a path stay in one piece
/// unless it alone has more than `limit`: then its pieces hold its own first `limit`, the next
/// `limit`, … So the cut of a path does not depend on other paths.
std::vector<Queue> split(const Queue& queue, size_t limit);

}  // namespace glint
