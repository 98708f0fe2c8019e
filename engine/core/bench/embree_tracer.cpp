#include "embree_tracer.h"

#include <limits>
#include <stdexcept>
#if defined(__SSE__)
#include <xmmintrin.h>
#endif

namespace glint::bench {
namespace {

constexpr size_t kStreamLength = 1024;

bool count_bytes(void* counter, ssize_t bytes, bool) {
  *static_cast<std::atomic<ptrdiff_t>*>(counter) += bytes;
  return true;
}

RTCBuildQuality embree_quality(Quality quality) {
  if (quality == Quality::kLow) return RTC_BUILD_QUALITY_LOW;
  return quality == Quality::kMedium ? RTC_BUILD_QUALITY_MEDIUM : RTC_BUILD_QUALITY_HIGH;
}

// Embree 3 takes a context with each call, Embree 4 its arguments last.
#if RTC_VERSION_MAJOR >= 4
struct Query {
  RTCIntersectArguments closest;
  RTCOccludedArguments any;
  explicit Query(bool coherent) {
    rtcInitIntersectArguments(&closest);
    rtcInitOccludedArguments(&any);
    closest.flags = any.flags =
        coherent ? RTC_RAY_QUERY_FLAG_COHERENT : RTC_RAY_QUERY_FLAG_INCOHERENT;
  }
};
void trace(RTCScene s, Query& q, const int*, RTCRayHit* r) { rtcIntersect1(s, r, &q.closest); }
void trace(RTCScene s, Query& q, const int* valid, RTCRayHit8* r) {
  rtcIntersect8(valid, s, r, &q.closest);
}
void trace(RTCScene s, Query& q, const int* valid, RTCRayHit16* r) {
  rtcIntersect16(valid, s, r, &q.closest);
}
void trace(RTCScene s, Query& q, const int*, RTCRay* r) { rtcOccluded1(s, r, &q.any); }
void trace(RTCScene s, Query& q, const int* valid, RTCRay8* r) {
  rtcOccluded8(valid, s, r, &q.any);
}
void trace(RTCScene s, Query& q, const int* valid, RTCRay16* r) {
  rtcOccluded16(valid, s, r, &q.any);
}
#else
struct Query {
  RTCIntersectContext context;
  explicit Query(bool coherent) {
    rtcInitIntersectContext(&context);
    context.flags =
        coherent ? RTC_INTERSECT_CONTEXT_FLAG_COHERENT : RTC_INTERSECT_CONTEXT_FLAG_INCOHERENT;
  }
};
void trace(RTCScene s, Query& q, const int*, RTCRayHit* r) { rtcIntersect1(s, &q.context, r); }
void trace(RTCScene s, Query& q, const int* valid, RTCRayHit8* r) {
  rtcIntersect8(valid, s, &q.context, r);
}
void trace(RTCScene s, Query& q, const int* valid, RTCRayHit16* r) {
  rtcIntersect16(valid, s, &q.context, r);
}
void trace(RTCScene s, Query& q, const int*, RTCRay* r) { rtcOccluded1(s, &q.context, r); }
void trace(RTCScene s, Query& q, const int* valid, RTCRay8* r) {
  rtcOccluded8(valid, s, &q.context, r);
}
void trace(RTCScene s, Query& q, const int* valid, RTCRay16* r) {
  rtcOccluded16(valid, s, &q.context, r);
}
void stream(RTCScene s, Query& q, RTCRayHit* r, size_t n) {
  rtcIntersect1M(s, &q.context, r, unsigned(n), sizeof *r);
}
void stream(RTCScene s, Query& q, RTCRay* r, size_t n) {
  rtcOccluded1M(s, &q.context, r, unsigned(n), sizeof *r);
}
#endif

/// Flushes denormals to zero while it lives, as Embree's manual asks callers to; Glint runs
/// without.
class FlushDenormals {
#if defined(__SSE__)
 public:
  FlushDenormals() : before_(_mm_getcsr()) { _mm_setcsr(before_ | 0x8040); }
  ~FlushDenormals() { _mm_setcsr(before_); }

 private:
  unsigned before_;
#else
 public:
  FlushDenormals() {}
#endif
};

template <int N>
struct Layout;
template <>
struct Layout<1> {
  using RayHit = RTCRayHit;
  using Ray = RTCRay;
};
template <>
struct Layout<8> {
  using RayHit = RTCRayHit8;
  using Ray = RTCRay8;
};
template <>
struct Layout<16> {
  using RayHit = RTCRayHit16;
  using Ray = RTCRay16;
};

// A field of a single ray is a number, of a packet an array.
template <class T>
T& lane(T& field, size_t) {
  return field;
}
template <class T, size_t N>
T& lane(T (&field)[N], size_t k) {
  return field[k];
}
template <class T>
const T& lane(const T& field, size_t) {
  return field;
}
template <class T, size_t N>
const T& lane(const T (&field)[N], size_t k) {
  return field[k];
}

template <class Ray>
void put_ray(Ray& ray, size_t k, const RaySet& rays, size_t at) {
  lane(ray.org_x, k) = float(rays.o[0][at]);
  lane(ray.org_y, k) = float(rays.o[1][at]);
  lane(ray.org_z, k) = float(rays.o[2][at]);
  lane(ray.dir_x, k) = float(rays.d[0][at]);
  lane(ray.dir_y, k) = float(rays.d[1][at]);
  lane(ray.dir_z, k) = float(rays.d[2][at]);
  lane(ray.tnear, k) = float(rays.t_min[at]);
  lane(ray.tfar, k) = float(rays.t_max[at]);
  lane(ray.time, k) = 0;
  lane(ray.mask, k) = ~0u;
  lane(ray.id, k) = 0;
  lane(ray.flags, k) = 0;
}

template <class Hit>
void clear_hit(Hit& hit, size_t k) {
  lane(hit.geomID, k) = RTC_INVALID_GEOMETRY_ID;
  lane(hit.primID, k) = RTC_INVALID_GEOMETRY_ID;
  lane(hit.instID[0], k) = RTC_INVALID_GEOMETRY_ID;
}

/// N rays in a packet; any hit: rays alone, without room for hits.
template <int N, bool kAnyHit, bool kStream = false>
class Packets final : public EmbreeRays {
  using Packet = std::conditional_t<kAnyHit, typename Layout<N>::Ray, typename Layout<N>::RayHit>;

 public:
  void fill(const RaySet& rays) override {
    count_ = rays.size();
    packets_.resize((count_ + N - 1) / N);
    for (size_t k = 0; k < packets_.size() * N; ++k) {
      Packet& packet = packets_[k / N];
      const size_t from = std::min(
          k, count_ - 1);  // lanes beyond the end are switched off, but hold numbers all the same
      if constexpr (kAnyHit) put_ray(packet, k % N, rays, from);
      else {
        put_ray(packet.ray, k % N, rays, from);
        clear_hit(packet.hit, k % N);
      }
    }
  }
  void closest(const EmbreeScene& scene, bool coherent, size_t first, size_t count) override {
    run(scene, coherent, first, count);
  }
  void occluded(const EmbreeScene& scene, bool coherent, size_t first, size_t count) override {
    run(scene, coherent, first, count);
  }

  void read(HitArrays& hits) const override {
    if constexpr (!kAnyHit) {
      for (size_t k = 0; k < count_; ++k) {
        const Packet& packet = packets_[k / N];
        const bool hit = lane(packet.hit.geomID, k % N) != RTC_INVALID_GEOMETRY_ID;
        const uint32_t instance = lane(packet.hit.instID[0], k % N);
        hits.instance[k] = !hit                                  ? glint::Hit::kNone
                           : instance == RTC_INVALID_GEOMETRY_ID ? 0
                                                                 : instance;
        hits.primitive[k] = lane(packet.hit.primID, k % N);
        hits.t[k] = double(lane(packet.ray.tfar, k % N));
        hits.u[k] = lane(packet.hit.u, k % N);
        hits.v[k] = lane(packet.hit.v, k % N);
      }
    }
  }
  void read(std::vector<uint8_t>& blocked) const override {
    if constexpr (kAnyHit)
      for (size_t k = 0; k < count_; ++k) blocked[k] = lane(packets_[k / N].tfar, k % N) < 0;
  }

 private:
  void run(const EmbreeScene& scene, bool coherent, size_t first, size_t count) {
    const FlushDenormals flush;
    Query query(coherent);
    const RTCScene s = scene.handle();
    alignas(64) int valid[N];
    std::fill(valid, valid + N, -1);
    size_t k = first;
    if constexpr (kStream) {
#if RTC_VERSION_MAJOR < 4
      for (; k < first + count; k += kStreamLength)
        stream(s, query, &packets_[k], std::min(kStreamLength, first + count - k));
#endif
      return;
    }
    for (; k + N <= first + count; k += N) trace(s, query, valid, &packets_[k / N]);
    if (k >= first + count) return;
    std::fill(valid + (first + count - k), valid + N, 0);
    trace(s, query, valid, &packets_[k / N]);
  }

  std::vector<Packet> packets_;
  size_t count_ = 0;
};

template <bool kAnyHit>
std::unique_ptr<EmbreeRays> make_rays(Feed feed) {
  if (feed == Feed::kSingle) return std::make_unique<Packets<1, kAnyHit>>();
  if (feed == Feed::kPacket8) return std::make_unique<Packets<8, kAnyHit>>();
  if (feed == Feed::kPacket16) return std::make_unique<Packets<16, kAnyHit>>();
  if (RTC_VERSION_MAJOR >= 4) return nullptr;
  return std::make_unique<Packets<1, kAnyHit, true>>();
}

RTCGeometry triangles(RTCDevice device, const test::Mesh& mesh, Quality quality) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
  rtcSetGeometryBuildQuality(geometry, embree_quality(quality));
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                             mesh.vertices.data(), 0, 12, mesh.vertices.size() / 3);
  rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                             mesh.triangles.data(), 0, 12, mesh.count());
  rtcCommitGeometry(geometry);
  return geometry;
}

RTCGeometry instance(RTCDevice device, RTCScene mesh, const Affine& m) {
  RTCGeometry geometry = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_INSTANCE);
  rtcSetGeometryInstancedScene(geometry, mesh);
  float columns[12];
  const Vec3d parts[4] = {m.x, m.y, m.z, m.t};
  for (int k = 0; k < 12; ++k) columns[k] = float(parts[k / 3][k % 3]);
  rtcSetGeometryTransform(geometry, 0, RTC_FORMAT_FLOAT3X4_COLUMN_MAJOR, columns);
  rtcCommitGeometry(geometry);
  return geometry;
}

void attach(RTCScene scene, RTCGeometry geometry, unsigned id) {
  rtcAttachGeometryByID(scene, geometry, id);
  rtcReleaseGeometry(geometry);
}

}  // namespace

const char* name_of(Quality quality) {
  if (quality == Quality::kLow) return "low";
  return quality == Quality::kMedium ? "medium" : "high";
}

const char* name_of(Feed feed) {
  if (feed == Feed::kSingle) return "single";
  if (feed == Feed::kStream) return "stream";
  return feed == Feed::kPacket8 ? "8-wide" : "16-wide";
}

EmbreeDevice::EmbreeDevice(const std::string& config) : device_(rtcNewDevice(config.c_str())) {
  if (!device_)
    throw std::runtime_error("no Embree device for \"" + config + "\": error " +
                             std::to_string(rtcGetDeviceError(nullptr)));
  rtcSetDeviceMemoryMonitorFunction(device_, count_bytes, &bytes_);
}
EmbreeDevice::~EmbreeDevice() { rtcReleaseDevice(device_); }

std::string EmbreeDevice::version() const {
  auto part = [&](RTCDeviceProperty property) {
    return std::to_string(rtcGetDeviceProperty(device_, property));
  };
  return part(RTC_DEVICE_PROPERTY_VERSION_MAJOR) + "." + part(RTC_DEVICE_PROPERTY_VERSION_MINOR) +
         "." + part(RTC_DEVICE_PROPERTY_VERSION_PATCH);
}

int EmbreeDevice::native_width() const {
  if (rtcGetDeviceProperty(device_, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)) return 16;
  return rtcGetDeviceProperty(device_, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? 8 : 4;
}

RTCScene EmbreeScene::add_scene(EmbreeDevice& device, Quality quality, bool robust,
                                bool compact) const {
  RTCScene scene = rtcNewScene(device.handle());
  rtcSetSceneBuildQuality(scene, embree_quality(quality));
  const int flags =
      (robust ? int(RTC_SCENE_FLAG_ROBUST) : 0) | (compact ? int(RTC_SCENE_FLAG_COMPACT) : 0);
  rtcSetSceneFlags(scene, RTCSceneFlags(flags));
  return scene;
}

EmbreeScene::EmbreeScene(EmbreeDevice& device, const World& world, Quality quality, bool robust,
                         bool compact)
    : scene_(add_scene(device, quality, robust, compact)) {
  const RTCGeometry mesh = triangles(device.handle(), world.mesh, quality);
  if (world.instances.empty()) {
    attach(scene_, mesh, 0);
  } else {
    mesh_ = add_scene(device, quality, robust, compact);
    attach(mesh_, mesh, 0);
    rtcCommitScene(mesh_);
    for (unsigned k = 0; k < world.instances.size(); ++k)
      attach(scene_, instance(device.handle(), mesh_, world.instances[k]), k);
  }
  rtcCommitScene(scene_);
}

EmbreeScene::~EmbreeScene() {
  rtcReleaseScene(scene_);
  if (mesh_) rtcReleaseScene(mesh_);
}

std::unique_ptr<EmbreeRays> EmbreeRays::make(Feed feed, bool any_hit) {
  return any_hit ? make_rays<true>(feed) : make_rays<false>(feed);
}

}  // namespace glint::bench
