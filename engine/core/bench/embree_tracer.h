// Embree 3 or 4 through its C interface: devices that count their memory, scenes, and rays laid out
// as Embree likes them best.
#pragma once
#include <atomic>
#include <memory>
#include <string>

#include "ray_sets.h"
#if __has_include(<embree4/rtcore.h>)
#include <embree4/rtcore.h>
#else
#include <embree3/rtcore.h>
#endif

namespace glint::bench {

enum class Quality { kLow, kMedium, kHigh };
const char* name_of(Quality quality);

/// How rays are handed over. kStream (Embree 3 only): rtcIntersect1M over many rays.
enum class Feed { kSingle, kPacket8, kPacket16, kStream };
const char* name_of(Feed feed);

class EmbreeDevice {
 public:
  /// `config`: as for rtcNewDevice. Throws std::runtime_error with Embree's reason.
  explicit EmbreeDevice(const std::string& config);
  ~EmbreeDevice();
  EmbreeDevice(const EmbreeDevice&) = delete;
  EmbreeDevice& operator=(const EmbreeDevice&) = delete;
  RTCDevice handle() const { return device_; }
  /// Held at present, as the memory monitor reports.
  ptrdiff_t bytes() const { return bytes_; }
  std::string version() const;
  /// The widest packet that runs in one go: 4, 8 or 16 rays. Shows which instruction set is at
  /// work.
  int native_width() const;

 private:
  RTCDevice device_;
  std::atomic<ptrdiff_t> bytes_{0};
};

class EmbreeScene {
 public:
  /// The world's arrays are shared, not copied. Embree drops spatial splits (high quality) when
  /// `robust`.
  EmbreeScene(EmbreeDevice& device, const World& world, Quality quality, bool robust,
              bool compact = false);
  ~EmbreeScene();
  EmbreeScene(const EmbreeScene&) = delete;
  EmbreeScene& operator=(const EmbreeScene&) = delete;
  RTCScene handle() const { return scene_; }

 private:
  RTCScene add_scene(EmbreeDevice& device, Quality quality, bool robust, bool compact) const;
  RTCScene scene_, mesh_ = nullptr;
};

/// The rays of a RaySet in one of Embree's layouts. Tracing overwrites them (Embree's interface),
/// so that `fill` comes before each run.
class EmbreeRays {
 public:
  virtual ~EmbreeRays() = default;
  virtual void fill(const RaySet& rays) = 0;
  /// Rays [first, first + count); first a multiple of 16.
  virtual void closest(const EmbreeScene& scene, bool coherent, size_t first, size_t count) = 0;
  virtual void occluded(const EmbreeScene& scene, bool coherent, size_t first, size_t count) = 0;
  /// What the last run found.
  virtual void read(HitArrays& hits) const = 0;
  virtual void read(std::vector<uint8_t>& blocked) const = 0;
  /// Null when this Embree has no such interface.
  static std::unique_ptr<EmbreeRays> make(Feed feed, bool any_hit);
};

}  // namespace glint::bench
