// Rays on their way, with what each carries to its pixel, by component.
#pragma once
#include <cmath>
#include <vector>

#include "bvh/accel.h"
#include "integrator/columns.h"
#include "math/vec.h"

namespace glint {

/// T: the weight to the pixel.  start: where the ray starts exactly, before it was moved clear of
/// its surface; surfaces are met from there. from: ray parameter up to which visible lights were
/// already counted.  slot: number of its camera ray (Paths).
struct Path {
  Vec3d T, start;
  double from = 0, share = 1;
  uint32_t slot = 0;
  uint8_t depth = 0, straight = 0;  // mirror and refraction rays so far; transparent ones in a row
  int64_t refractions = 0;          // those bits of its tag
  bool wants_data = false, transmitted = false;  // transmitted: refracted by its first surface
  bool skyless = false;                          // see RayTag, as the next
  double widest = HUGE_VAL;
};

/// Rays that look for the same visibility: kCamera at depth 0, one of a path, else kMirror,
/// kDiffuse of gather rays, or kTransmission, where instances differ in these.
class Queue : public RayLayout {
 public:
  explicit Queue(uint32_t visibility_ = kMirror) : visibility(visibility_) {}

  size_t size() const { return size_; }
  void clear() {
    size_ = 0;
    hits_.clear();
  }
  /// Room for so many rays in all.
  void reserve(size_t count);
  void push(const Ray& ray, const Path& path);
  /// Of a queue of `exits`, with what the ray meets.
  void push(const Ray& ray, const Path& path, const Hit& hit) {
    push(ray, path);
    hits_.push_back(hit);
  }
  /// Adds ray k of another queue as it is; of this one where at most k rays are left in it.
  void append(const Queue& from, size_t k);
  /// Moves the rays whose last bounce was a refraction to another queue, in order.
  void give_refracted(Queue& to);
  /// Where a stage adds rays.
  RayEnd end() { return {columns_[0], columns_.stride(), tags_.data(), &size_}; }
  /// `count` rays from o = start = 0 with weight 1, but for what was written there after an earlier
  /// call; directions, bounds and who wants data are to be filled in. Nothing is ever pushed here.
  void start_at_camera(size_t count);

  Ray ray(size_t k) const {
    return {at(kO, k), at(kD, k), columns_[kTMin][k], columns_[kTMax][k], visibility};
  }
  Path path(size_t k) const {
    return {
        at(kT, k),     at(kStart, k),     columns_[kFrom][k], columns_[kShare][k],
        slot(k),       depth(k),          straight(k),        tags_[k] & RayTag::kAllRefractions,
        wants_data(k), is_transmitted(k), is_skyless(k),      widest(k)};
  }
  double share(size_t k) const { return columns_[kShare][k]; }
  Vec3d weight(size_t k) const { return at(kT, k); }
  uint32_t slot(size_t k) const { return uint32_t(tags_[k]); }
  bool wants_data(size_t k) const { return tags_[k] >> RayTag::kWantsData & 1; }
  void want_data(size_t k) {
    tags_[k] |= int64_t(1) << RayTag::kWantsData;
    numbered_ = 0;
  }
  bool wants_aovs(size_t k) const { return tags_[k] >> RayTag::kWantsAovs & 1; }
  void want_aovs(size_t k) {
    tags_[k] |= int64_t(1) << RayTag::kWantsAovs;
    numbered_ = 0;
  }
  bool is_refracted(size_t k) const { return tags_[k] >> RayTag::kRefracted & 1; }
  /// What lies behind everything is not seen.
  bool is_skyless(size_t k) const { return tags_[k] >> RayTag::kSkyless & 1; }
  bool is_transmitted(size_t k) const { return tags_[k] >> RayTag::kTransmitted & 1; }
  uint8_t depth(size_t k) const { return uint8_t(tags_[k] >> RayTag::kDepth); }
  Rays rays() const;
  double* column(size_t c) { return columns_[c]; }
  const double* column(size_t c) const { return columns_[c]; }
  size_t stride() const { return columns_.stride(); }
  const int64_t* tags() const { return tags_.data(); }

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
  /// The largest exponent of highlights that ray k meets: a power of two, that of the narrowest
  /// lobe of the roughest surface on its way.
  double widest(size_t k) const {
    const int64_t code = (tags_[k] & RayTag::kWidths) >> RayTag::kWidth;
    return code == 0 ? HUGE_VAL : std::ldexp(1.0, int(code - 1));
  }

 private:
  uint8_t straight(size_t k) const { return uint8_t(tags_[k] >> RayTag::kStraight); }
  Vec3d at(size_t column, size_t k) const {
    return {columns_[column][k], columns_[column + 1][k], columns_[column + 2][k]};
  }
  void put(size_t column, size_t k, Vec3d v) {
    columns_[column][k] = v.x;
    columns_[column + 1][k] = v.y;
    columns_[column + 2][k] = v.z;
  }

  Columns columns_{kColumns};
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
