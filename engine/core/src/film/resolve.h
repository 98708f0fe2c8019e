// Light that is sampled at other points by each pixel of a block, averaged over the pixels that
// show the same surface (Keller, Heidrich 2001, Interleaved sampling; Wald, Kollig, Benthin,
// Keller, Slusallek 2002, Interactive global illumination using fast ray tracing: the discontinuity
// buffer). What pixels differ by no more than the halves of their own samples do is what their
// points leave, and is averaged away; the rest stays (Lee 1980, Digital image enhancement and noise
// filtering by use of local statistics), of what repeats from block to block lines, and what is
// beyond all chance. Of few samples, whose halves tell nothing, all is averaged. What mirrors and
// clear glass show is averaged over the surfaces that are seen there; what gives light itself
// stays.
#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "film/passes.h"
#include "film/refine.h"
#include "system/zeroed_buffer.h"

namespace glint {

/// Light that is resolved by itself: what surfaces that camera rays meet give back, of lights and
/// by way of others; what surfaces do that mirrors, and that clear glass shows; the light of
/// catchers; what is open over surfaces; what else is in Diffuse and Glossy Direct (`passes.h`);
/// and what media scatter.
enum ResolvedLight : int {
  kDiffuseDirect,
  kDiffuseIndirect,
  kGlossyDirect,
  kGlossyIndirect,
  kTransmissionDirect,
  kTransmissionIndirect,
  kMirrored,
  kRefracted,
  kCaught,
  kOpen,
  kOtherDiffuseDirect,
  kOtherGlossyDirect,
  kVolumeDirect,
  kVolumeIndirect,
  kResolvedLights
};

/// What light is told over: colours of surfaces, or the same light with nothing in its way; of
/// media nothing.
enum LightKind : int {
  kDiffuseColor,
  kGlossyColor,
  kTransmissionColor,
  kMirroredSurfaces,
  kRefractedSurfaces,
  kCaughtSurfaces,
  kOpenSurfaces,
  kUnshadowedMatt,
  kUnshadowedGlossy,
  kColoredKinds
};
constexpr int kFirstSharp = kGlossyColor, kSharpKinds = 2;  // of which parts are images
/// Of which surfaces a light is, and what it is told over.
constexpr int kind_of(int light) {
  constexpr int kinds[kResolvedLights] = {kDiffuseColor,     kDiffuseColor,      kGlossyColor,
                                          kGlossyColor,      kTransmissionColor, kTransmissionColor,
                                          kMirroredSurfaces, kRefractedSurfaces, kCaughtSurfaces,
                                          kOpenSurfaces,     kDiffuseColor,      kGlossyColor,
                                          kColoredKinds,     kColoredKinds};
  return kinds[light];
}
constexpr int told_over(int light) {
  return light == kDiffuseDirect  ? int(kUnshadowedMatt)
         : light == kGlossyDirect ? int(kUnshadowedGlossy)
                                  : kind_of(light);
}
/// What is looked at to tell one from noise: of gloss what lights and other surfaces give it
/// together, as one hides the other.
inline std::span<const int> looked_at(int light) {
  static constexpr int kAll[kResolvedLights] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13},
                       kGloss[] = {kGlossyDirect, kGlossyIndirect, kOtherGlossyDirect};
  const bool is_gloss = kind_of(light) == kGlossyColor;
  return is_gloss ? std::span<const int>(kGloss) : std::span<const int>(kAll + light, 1);
}
/// Of which surfaces guides tell: those that camera rays meet, those in mirrors and behind clear
/// glass.
enum GuideSet : int { kSeen, kInMirrors, kBehindGlass, kGuideSets };
constexpr GuideSet guides_of(int light) {
  return light == kMirrored ? kInMirrors : light == kRefracted ? kBehindGlass : kSeen;
}

/// The film's columns of a pixel that a resolve reads beside the passes of light: of the surfaces
/// of each set, as much of each as stays of the ray there, the normal, the place, and how
/// much stays; of the first half of the samples each light, and the colours of surfaces; what of
/// glossy colour and of that of transmission mirrors and clear glass have. Of all but the normal
/// and the place the sum of the channels.
enum GuideColumn : int {
  kGuideNormal = 0,
  kGuidePlace = 3,
  kGuideShare = 6,
  kGuidesOfOne = 7,
  kHalfLight = kGuidesOfOne * kGuideSets,
  kHalfColor = kHalfLight + kResolvedLights,
  kSharpColor = kHalfColor + kColoredKinds,
  kGuideColumns = kSharpColor + kSharpKinds
};

/// What gives light itself, which more camera rays may see: surfaces and media, and the
/// surroundings.
constexpr int kGlows = 2;

constexpr double kMostRatio = 1000;

/// Which share of their light other things leave to catchers, or how many times they throw there.
inline double caught_ratio(double with, double without) {
  return without > 0 ? std::clamp(with / without, 0.0, kMostRatio) : 1;
}

/// Pixels of a tile and round it, row by row, a column a quantity: means over a pixel's samples, 0
/// beyond the region.
struct ResolveWindow {
  enum Column : int {
    kNormal = 0,
    kPlace = 3,
    kPlaceLow = 6,  // what single precision leaves of it
    kSurface = 9,   // 1 where there is one
    kShare = 10,    // how much of the rays stays at surfaces
    kAlong = 11,    // how long the mean of their normals is, times that
    kGuidesOfOne = 12,
    kColor = kGuidesOfOne * kGuideSets,  // of each kind: three channels; of media 1
    kLight = kColor + 3 * (kColoredKinds + 1),
    kNoise = kLight + 3 * kResolvedLights,  // of light without its colour, how far the mean is off:
                                            // half of what halves differ by
    kUnshadowedNoise = kNoise + kResolvedLights,  // the same of both kinds of unshadowed light
    kSharp = kUnshadowedNoise + 2,   // of glossy colour and of that of transmission, which
                                     // share mirrors and clear glass have
    kShadow = kSharp + kSharpKinds,  // what shadows change of what catchers show, and what these do
    kUnshadedColor = kShadow + 3,    // without them
    kRest = kUnshadedColor + 3,      // of the picture but for light that is resolved; lost alpha
    kGlow = kRest + 4,               // of each of what gives light itself
    kWhole = kGlow + 3 * kGlows,     // the picture
    kInside = kWhole + 3,            // 1: a pixel of the region
    kSampleShare = kInside + 1,      // which part of its camera rays are samples
    kColumns = kSampleShare + 1
  };
  uint32_t width = 0, height = 0;
  std::vector<float> values;
  void set_size(uint32_t w, uint32_t h) {
    width = w;
    height = h;
    values.assign(size_t(kColumns) * w * h, 0.0f);
  }
  size_t pixels() const { return size_t(width) * height; }
  float* column(int number) { return values.data() + size_t(number) * pixels(); }
  const float* column(int number) const { return values.data() + size_t(number) * pixels(); }
  const float* guide(GuideSet set, int number) const { return column(set * kGuidesOfOne + number); }
};

/// What resolving adds to the means of the pixels of a region. One thread a tile at a time.
class Resolve {
 public:
  /// Whether there are catchers, and what has their shadows: a pass, or of Combined, there grey,
  /// lost alpha or colour.
  enum class Catches { kNone, kPass, kAlpha, kColor };

  Resolve() = default;
  /// side: of blocks of pixels. kept: bits of what passes show by themselves, as `added_to`
  /// numbers it.
  Resolve(uint32_t side, Region region, uint32_t kept, Catches catches);

  bool on() const { return side_ > 1; }
  /// Pixels to each side that what is added to one depends on: half a block of which it takes in
  /// light, and whether that repeats in the next one.
  static constexpr uint32_t looks_at(uint32_t side) { return side / 2 + side; }
  uint32_t looks_at() const { return looks_at(side_); }
  /// Of the pixels of a window but for `looks_at` at its ends, row by row, which show with those
  /// round them more than one surface of one colour: what their samples miss of it may be seen.
  std::vector<uint8_t> uneven(const ResolveWindow& window) const;
  /// Resolves the pixels of a window but for `looks_at` at its ends; the first of them is (x0, y0)
  /// of the region. finer: these pixels alone, from more camera rays, but for their light; null for
  /// none. is_halved: pixels have two halves of several samples.
  void run(const ResolveWindow& window, const ResolveWindow* finer, uint32_t x0, uint32_t y0,
           bool is_halved);
  /// Of a pixel, to the mean of Combined's colour and of lost alpha.
  const float* added(uint32_t pixel) const { return added_.data() + 4 * size_t(pixel); }
  /// The same to the mean of one light, or of what gives light itself, after these; 0 where no pass
  /// shows it.
  float added_to(int light, uint32_t pixel, size_t channel) const {
    return lights_[light].size() ? lights_[light].data()[3 * size_t(pixel) + channel] : 0;
  }

 private:
  uint32_t side_ = 1, width_ = 0;
  Catches catches_ = Catches::kNone;
  ZeroedBuffer<float> added_, lights_[kResolvedLights + kGlows];
};

}  // namespace glint
