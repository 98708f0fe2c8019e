// Glint and Embree on the same rays, interleaved in one process. `embree_bench --help` lists the
// options; tests/bench/rays.py runs it over many meshes and makes the tables.
//
// Per ray kind: every mode of Embree (build quality, robust or not, single rays, packets, streams,
// coherent or not) traces a quarter of the rays once, on one thread; those within `--keep` of the
// best robust and of the best fast mode, four each at most, then take turns with Glint for
// `--rounds` rounds, fewer where these take long; rates are medians. Embree's rays lie filled in
// its own layout, Glint's in columns, before the clock starts; both write complete hits. The
// primary rays are also made by Glint's core while the clock runs, as in whole frames: those are
// its rays `camera`.
#include <cstdlib>
#include <cstring>
#include <stdexcept>

#include "camera_blocks.h"
#include "clock.h"
#include "embree_tracer.h"
#include "report.h"

using namespace glint;
using namespace glint::bench;

namespace {

constexpr int kMostKept = 4;   // of Embree's robust modes, and of its fast ones
constexpr double kEnough = 3;  // seconds of measuring after which two rounds will do

struct Options {
  std::string mesh = "bumpy:132x264", rays = "primary,shadow,mirror,diffuse", only, json,
              config = "frequency_level=simd512";
  uint32_t size = 1024;
  int rounds = 5, threads = 2;
  double keep = 0.85;
  bool build = true, traverse = true;
};

const char* const kHelp =
    "embree_bench [--mesh icosphere:LEVEL|bumpy:ROWSxCOLUMNS|instances:COUNT|FILE] [--rays "
    "primary,shadow,mirror,diffuse]\n"
    "             [--size 1024] [--rounds 5] [--threads 2: up to so many] [--keep 0.85] [--only "
    "TEXT: Embree's modes whose name holds it]\n"
    "             [--no-build] [--no-traversal] [--config TEXT for rtcNewDevice] [--json FILE]\n";

struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

Options parse(int argc, char** argv) {
  Options options;
  for (int k = 1; k < argc; ++k) {
    const std::string key = argv[k];
    if (key == "--no-build") {
      options.build = false;
      continue;
    }
    if (key == "--no-traversal") {
      options.traverse = false;
      continue;
    }
    if (k + 1 == argc) throw UsageError(kHelp);
    const std::string value = argv[++k];
    if (key == "--mesh") options.mesh = value;
    else if (key == "--rays") options.rays = value;
    else if (key == "--only") options.only = value;
    else if (key == "--json") options.json = value;
    else if (key == "--config") options.config = value;
    else if (key == "--size") options.size = uint32_t(std::atoi(value.c_str()));
    else if (key == "--rounds") options.rounds = std::atoi(value.c_str());
    else if (key == "--threads") options.threads = std::atoi(value.c_str());
    else if (key == "--keep") options.keep = std::atof(value.c_str());
    else throw UsageError(kHelp);
  }
  if (options.size < 4 || (options.size & (options.size - 1)) || options.rounds < 1 ||
      options.threads < 1)
    throw UsageError(kHelp);
  return options;
}

std::string device_config(const Options& options, int threads) {
  return "threads=" + std::to_string(threads) + "," + options.config;
}

std::unique_ptr<Accel> build_glint(const World& world, int threads,
                                   BuildQuality quality = BuildQuality::kBalanced) {
  const std::atomic<bool> cancel{false};
  std::vector<InstanceView> instances(std::max<size_t>(1, world.instances.size()));
  for (size_t k = 0; k < world.instances.size(); ++k)
    instances[k].world_from_object = world.instances[k];
  return Accel::build({world.mesh.view()}, instances, threads, cancel, quality);
}

// ---- builds ----

/// One way to build a tree, and what it took each time.
struct Builder {
  std::string tracer, quality;
  bool robust, compact;
  int threads;
  std::vector<double> cpu, wall;
  double bytes = 0;
};

void build_once(Builder& b, const Options& options, const World& world) {
  std::unique_ptr<EmbreeDevice> device;
  std::unique_ptr<EmbreeScene> scene;
  std::unique_ptr<Accel> accel;
  if (b.tracer == "embree")
    device = std::make_unique<EmbreeDevice>(device_config(options, b.threads));
  const ptrdiff_t before = device ? device->bytes() : 0;
  const double cpu = process_seconds(), wall = wall_seconds();
  if (device) {
    const Quality quality = b.quality == "low"      ? Quality::kLow
                            : b.quality == "medium" ? Quality::kMedium
                                                    : Quality::kHigh;
    scene = std::make_unique<EmbreeScene>(*device, world, quality, b.robust, b.compact);
  } else {
    const bool fast = b.quality == "fast", fine = b.quality == "fine";
    accel = build_glint(world, b.threads,
                        fast   ? BuildQuality::kFast
                        : fine ? BuildQuality::kFine
                               : BuildQuality::kBalanced);
  }
  b.cpu.push_back(process_seconds() - cpu);
  b.wall.push_back(wall_seconds() - wall);
  b.bytes = device ? double(device->bytes() - before) : double(accel->stats().bytes);
}

void add_builds(Report& report, const Options& options, const World& world) {
  std::vector<Builder> builders;
  for (int threads = 1; threads <= options.threads; ++threads) {
    for (const char* quality : {"balanced", "fast", "fine"})
      builders.push_back({"glint", quality, true, false, threads, {}, {}});
    for (const char* quality : {"low", "medium", "high"})
      builders.push_back({"embree", quality, false, false, threads, {}, {}});
    builders.push_back({"embree", "medium", true, false, threads, {}, {}});
    if (threads == 1) builders.push_back({"embree", "medium", true, true, threads, {}, {}});
  }
  for (int round = 0; round < std::min(options.rounds, 3); ++round)
    for (Builder& b : builders)
      if (round == 0 || b.wall[0] * round < kEnough) build_once(b, options, world);
  for (const Builder& b : builders) {
    const double cpu = median(b.cpu), wall = median(b.wall),
                 each = b.bytes / double(world.mesh.count());
    report.lists["builds"].push_back(Row()
                                         .word("tracer", b.tracer)
                                         .word("quality", b.quality)
                                         .truth("robust", b.robust)
                                         .truth("compact", b.compact)
                                         .number("threads", b.threads)
                                         .number("cpu_seconds", cpu)
                                         .number("wall_seconds", wall)
                                         .number("bytes_per_triangle", each));
    std::printf(
        "build %-7s %-8s%s%s %d threads: %8.2f ms cpu %8.2f ms wall, %6.1f bytes/triangle\n",
        b.tracer.c_str(), b.quality.c_str(), b.robust ? " robust" : "", b.compact ? " compact" : "",
        b.threads, 1e3 * cpu, 1e3 * wall, each);
  }
}

// ---- traversal ----

/// One way to trace a set of rays.
struct Mode {
  std::string name;  // "glint" and its tree, or feed, coherence, quality
  bool embree = true, robust = true, coherent = false, fine = false;
  bool camera = false;  // Glint makes the rays
  Quality quality = Quality::kMedium;
  Feed feed = Feed::kSingle;
  const RaySet* rays = nullptr;
  bool reversed = false;
  std::vector<double> rates;  // million rays a second
};

struct Kind {
  std::string name;
  bool any_hit;
  const RaySet *rays, *reversed;  // reversed: the same segments from the other end, or null
};

class Traversal {
 public:
  Traversal(const Options& options, const World& world, Report& report)
      : options_(options),
        instanced_(!world.instances.empty()),
        view_(world.view),
        report_(report),
        device_(device_config(options, options.threads)) {
    accels_[0] = build_glint(world, options.threads);
    accels_[1] = build_glint(world, options.threads, BuildQuality::kFine);
    for (int q = 0; q < 3; ++q)
      for (int r = 0; r < 2; ++r)
        scenes_[q][r] = std::make_unique<EmbreeScene>(device_, world, Quality(q), r != 0);
    frame_ = make_rays(world, *accels_[0], options.size);
  }

  void run() {
    const Kind kinds[] = {{"primary", false, &frame_.primary, nullptr},
                          {"shadow", true, &frame_.shadow, &frame_.shadow_from_light},
                          {"mirror", false, &frame_.mirror, nullptr},
                          {"diffuse", false, &frame_.diffuse, nullptr}};
    for (const Kind& kind : kinds)
      if (("," + options_.rays + ",").find("," + kind.name + ",") != std::string::npos &&
          kind.rays->size() > 0)
        run(kind);
  }

 private:
  void run(const Kind& kind) {
    compare_answers(kind);
    std::vector<Mode> modes = keep_best(kind);
    for (int threads = 1; threads <= options_.threads; ++threads) {
      const double start = wall_seconds();
      for (Mode& mode : modes) mode.rates.clear();
      for (int round = 0;
           round < options_.rounds && (round < 2 || wall_seconds() - start < kEnough); ++round)
        for (Mode& mode : modes) measure(mode, kind, threads, 0, mode.rays->size());
      for (const Mode& mode : modes) add_row(mode, kind, threads);
    }
  }

  /// Glint's modes, and those of Embree's that one run with a quarter of the rays shows near the
  /// best.
  std::vector<Mode> keep_best(const Kind& kind) {
    std::vector<Mode> kept;
    double best[2] = {};
    std::vector<Mode> candidates = embree_modes(kind);
    for (Mode& mode : candidates) {
      const size_t all = mode.rays->size(), some = all / 256 * 64;
      measure(mode, kind, 1, some, some > 0 ? some : all);
      best[mode.robust] = std::max(best[mode.robust], mode.rates[0]);
    }
    for (Mode& mode : candidates) {
      const bool baseline = mode.feed == Feed::kSingle && !mode.coherent &&
                            mode.quality == Quality::kMedium && !mode.reversed;
      const auto better = [&](const Mode& other) {
        return other.robust == mode.robust && other.rates[0] > mode.rates[0];
      };
      const bool among_best =
          std::count_if(candidates.begin(), candidates.end(), better) < kMostKept;
      if (!baseline && !(among_best && mode.rates[0] >= options_.keep * best[mode.robust]))
        continue;
      kept.push_back(mode);
    }
    for (const bool fine : {false, true}) {
      add_glint(kept, kind, false, fine);
      if (kind.name == "primary") {
        add_glint(kept, kind, false, fine);
        kept.back().camera = true;
      }
      if (kind.reversed) add_glint(kept, kind, true, fine);
    }
    return kept;
  }

  static void add_glint(std::vector<Mode>& modes, const Kind& kind, bool reversed, bool fine) {
    Mode mode;
    mode.name = std::string(fine ? "glint, fine" : "glint, balanced") +
                (reversed ? ", from the light" : "");
    mode.embree = false;
    mode.fine = fine;
    mode.rays = reversed ? kind.reversed : kind.rays;
    mode.reversed = reversed;
    modes.push_back(mode);
  }

  /// Seen with Embree 3.13.5: coherent packets of secondary rays over 10 000 instances never come
  /// back, depending on what ran before. Where they do come back they are slower than incoherent
  /// ones.
  bool hangs(const Mode& mode, const Kind& kind) const {
    const bool packet = mode.feed == Feed::kPacket8 || mode.feed == Feed::kPacket16;
    return RTC_VERSION_MAJOR < 4 && instanced_ && kind.name != "primary" && mode.coherent && packet;
  }

  std::vector<Mode> embree_modes(const Kind& kind) const {
    std::vector<Mode> modes;
    for (int bits = 0; bits < 3 * 4 * 8; ++bits) {
      Mode mode;
      mode.quality = Quality(bits % 3);
      mode.feed = Feed(bits / 3 % 4);
      mode.robust = bits / 12 & 1;
      mode.coherent = bits / 24 & 1;
      mode.reversed = bits / 48 & 1;
      if (mode.reversed && !kind.reversed) continue;
      mode.rays = mode.reversed ? kind.reversed : kind.rays;
      mode.name = std::string(name_of(mode.feed)) + (mode.coherent ? ", coherent, " : ", ") +
                  name_of(mode.quality) + (mode.robust ? ", robust" : ", fast") +
                  (mode.reversed ? ", from the light" : "");
      if (mode.name.find(options_.only) == std::string::npos ||
          !EmbreeRays::make(mode.feed, false) || hangs(mode, kind))
        continue;
      modes.push_back(mode);
    }
    return modes;
  }

  /// Traces the mode's rays [first, first + count).
  void measure(Mode& mode, const Kind& kind, int threads, size_t first, size_t count) {
    const double seconds = mode.embree ? embree_seconds(mode, kind, threads, first, count)
                                       : glint_seconds(mode, kind, threads);
    mode.rates.push_back(1e-6 * double(count) / seconds);
  }

  double glint_seconds(const Mode& mode, const Kind& kind, int threads) {
    if (mode.camera) return camera_seconds(*accels_[mode.fine], threads);
    make_room(mode.rays->size());
    const Accel& accel = *accels_[mode.fine];
    return parallel_seconds(mode.rays->size(), threads, [&](size_t first, size_t count) {
      const Rays rays = mode.rays->view(first, count);
      Scratch scratch;
      if (kind.any_hit) accel.occluded(rays, &blocked_[first], scratch);
      else accel.closest(rays, hits_->from(first), scratch);
    });
  }

  double camera_seconds(const Accel& accel, int threads) {
    return parallel_seconds(frame_.primary.size(), threads, [&](size_t first, size_t count) {
      CameraBlocks blocks(view_, options_.size);
      Scratch scratch;
      for (const size_t end = first + count; first < end;) {
        const size_t some =
            std::min(end - first, CameraBlocks::kMost - first % CameraBlocks::kMost);
        accel.closest(blocks.make(first, some), blocks.hits(), scratch);
        first += some;
      }
    });
  }

  double embree_seconds(const Mode& mode, const Kind& kind, int threads, size_t begin, size_t all) {
    std::unique_ptr<EmbreeRays>& rays = layouts_[int(mode.feed)][kind.any_hit];
    if (!rays) rays = EmbreeRays::make(mode.feed, kind.any_hit);
    rays->fill(*mode.rays);
    const EmbreeScene& scene = *scenes_[int(mode.quality)][mode.robust];
    return parallel_seconds(all, threads, [&](size_t first, size_t count) {
      if (kind.any_hit) rays->occluded(scene, mode.coherent, begin + first, count);
      else rays->closest(scene, mode.coherent, begin + first, count);
    });
  }

  void make_room(size_t count) {
    if (blocked_.size() >= count) return;
    hits_ = std::make_unique<HitArrays>(count);
    blocked_.resize(count);
  }

  void add_row(const Mode& mode, const Kind& kind, int threads) {
    const double rate = median(mode.rates);
    const auto [low, high] = std::minmax_element(mode.rates.begin(), mode.rates.end());
    const char* tracer = mode.embree ? "embree" : "glint";
    const std::string rays = mode.camera ? "camera" : kind.name;
    report_.lists["traversal"].push_back(Row()
                                             .word("rays", rays)
                                             .number("threads", threads)
                                             .word("tracer", tracer)
                                             .word("mode", mode.name)
                                             .truth("robust", mode.robust)
                                             .number("mrays", rate)
                                             .number("slowest", *low)
                                             .number("fastest", *high)
                                             .number("count", double(mode.rays->size())));
    std::printf("%-8s %d threads  %-7s %-45s %8.2f Mrays/s  (%.2f .. %.2f)\n", rays.c_str(),
                threads, tracer, mode.name.c_str(), rate, *low, *high);
    std::fflush(stdout);
  }

  /// Glint against Embree's single robust rays: how many hits differ.
  void compare_answers(const Kind& kind) {
    Mode theirs, mine;
    theirs.rays = mine.rays = kind.rays;
    mine.embree = false;
    const size_t count = kind.rays->size();
    measure(theirs, kind, 1, 0, count);
    measure(mine, kind, 1, 0, count);
    const EmbreeRays& rays = *layouts_[int(Feed::kSingle)][kind.any_hit];
    size_t hits = 0, found = 0, distance = 0, primitive = 0;
    if (kind.any_hit) {
      std::vector<uint8_t> expected(count);
      rays.read(expected);
      for (size_t k = 0; k < count; ++k) {
        hits += expected[k];
        found += expected[k] != blocked_[k];
      }
    } else {
      HitArrays expected(count);
      rays.read(expected);
      for (size_t k = 0; k < count; ++k) {
        const bool hit = expected.instance[k] != Hit::kNone;
        hits += hit;
        if (hit != (hits_->instance[k] != Hit::kNone)) {
          ++found;
          continue;
        }
        if (!hit) continue;
        distance += std::fabs(expected.t[k] - hits_->t[k]) > 1e-4 * hits_->t[k];
        primitive += expected.primitive[k] != hits_->primitive[k] ||
                     expected.instance[k] != hits_->instance[k];
      }
    }
    add_answers(kind, count, hits, found, distance, primitive);
  }

  void add_answers(const Kind& kind, size_t count, size_t hits, size_t found, size_t distance,
                   size_t primitive) {
    const double per_million = 1e6 / double(count);
    report_.lists["answers"].push_back(
        Row()
            .word("rays", kind.name)
            .number("count", double(count))
            .number("hits", double(hits))
            .number("hit_or_miss_per_million", double(found) * per_million)
            .number("distance_per_million", double(distance) * per_million)
            .number("primitive_per_million", double(primitive) * per_million));
    std::printf(
        "%-8s %zu rays, %zu hit; per million differ: hit or miss %.1f, distance %.1f, primitive "
        "%.1f\n",
        kind.name.c_str(), count, hits, double(found) * per_million, double(distance) * per_million,
        double(primitive) * per_million);
  }

  const Options& options_;
  bool instanced_;
  View view_;
  Report& report_;
  EmbreeDevice device_;
  std::unique_ptr<EmbreeScene> scenes_[3][2];
  std::unique_ptr<Accel> accels_[2];  // balanced, fine
  FrameRays frame_;
  std::unique_ptr<EmbreeRays> layouts_[4][2];
  std::unique_ptr<HitArrays> hits_;
  std::vector<uint8_t> blocked_;
};

void run(const Options& options) {
  const World world = load_world(options.mesh);
  Report report;
  {
    const EmbreeDevice device(device_config(options, 1));
    const char* isa = std::getenv("GLINT_ISA");
    report.head.word("mesh", options.mesh)
        .number("triangles", double(world.mesh.count()))
        .number("instances", double(world.instances.size()))
        .number("size", options.size)
        .number("rounds", options.rounds)
        .word("embree", device.version())
        .number("embree_native_width", device.native_width())
        .word("embree_config", options.config)
        .word("glint_isa", isa ? isa : "default");
    std::printf("%s: %zu triangles, %zu instances; Embree %s, native packets of %d\n",
                options.mesh.c_str(), world.mesh.count(), world.instances.size(),
                device.version().c_str(), device.native_width());
  }
  if (options.build) add_builds(report, options, world);
  if (options.traverse) Traversal(options, world, report).run();
  if (options.json.empty()) return;
  std::FILE* file = std::fopen(options.json.c_str(), "w");
  if (!file) throw std::runtime_error("cannot write " + options.json);
  std::fputs(report.text().c_str(), file);
  std::fclose(file);
}

}  // namespace

int main(int argc, char** argv) {
  try {
    run(parse(argc, argv));
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
}
