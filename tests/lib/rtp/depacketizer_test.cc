// SPDX-License-Identifier: LGPL-2.1-or-later
#include "lib/rtp/rtp_test.h"
#include "rtp/depacketizer.h"

namespace lf::rtp {
namespace {

// Adds packets. Returns a letter for each: N(ew), D(uplicate), R(estarted).
std::string add(SequenceWindow& window, std::initializer_list<int> sequences, uint32_t timestamp = 7) {
  using Verdict = SequenceWindow::Verdict;
  std::string letters;
  for (const int sequence : sequences) {
    const Verdict verdict = window.add(static_cast<uint16_t>(sequence), timestamp);
    letters += verdict == Verdict::kNew ? 'N' : verdict == Verdict::kDuplicate ? 'D' : 'R';
  }
  return letters;
}

TEST(SequenceWindow, CountsGapsUntilTheyAreFilled) {
  SequenceWindow window;
  EXPECT_EQ(add(window, {65533, 65534, 1, 3}), "NNNN");
  EXPECT_EQ(window.lost(), 3u);  // 65535, 0, 2
  EXPECT_EQ(add(window, {2, 65535}), "NN");
  EXPECT_EQ(window.lost(), 1u);
  EXPECT_EQ(add(window, {65532}), "N") << "earlier than the first packet: never counted as missing";
  EXPECT_EQ(window.lost(), 1u);
}

TEST(SequenceWindow, DetectsDuplicates) {
  SequenceWindow window;
  for (int s = 0; s < 3 * SequenceWindow::kSize; s++) {
    EXPECT_EQ(add(window, {s, s}), "ND");
    for (const int back : {1, 5, SequenceWindow::kSize - 1}) EXPECT_TRUE(s < back || add(window, {s - back}) == "D");
  }
  EXPECT_EQ(window.lost(), 0u);
}

TEST(SequenceWindow, LongGap) {
  SequenceWindow window;
  EXPECT_EQ(add(window, {0, 2000}), "NN");
  EXPECT_EQ(window.lost(), 1999u);
  for (int s = 2000 - SequenceWindow::kSize + 1; s < 2000; s++) EXPECT_EQ(add(window, {s}), "N");
  EXPECT_EQ(window.lost(), 1999u - SequenceWindow::kSize + 1);
}

TEST(SequenceWindow, DetectsARestartedSender) {
  for (const int from : {30000, 100 - SequenceWindow::kSize - 5, -20000}) {
    SequenceWindow window;
    EXPECT_EQ(add(window, {100, from, from + 1, from + 1, from + 3}), "NNRDN") << "the second may be a stray packet";
    EXPECT_EQ(window.lost(), 1u);
  }
  SequenceWindow window;
  EXPECT_EQ(add(window, {100, 30000, 101, 30001, 100}), "NNNND");
  EXPECT_EQ(window.lost(), 0u);
}

TEST(SequenceWindow, EqualNumbersWithOtherTimestampsAreNew) {
  SequenceWindow window;
  for (int s = 100; s < 120; s++) add(window, {s}, 1000);
  EXPECT_EQ(add(window, {105, 106, 105}, 9000), "RND");
  EXPECT_EQ(window.lost(), 0u);
}

using enum Reassembly::Result;

std::vector<uint8_t> numbers(size_t count) {
  std::vector<uint8_t> out(count);
  std::iota(out.begin(), out.end(), uint8_t{1});
  return out;
}

class ReassemblyTest : public testing::Test {
 protected:
  Reassembly::Result add(uint16_t unit, uint32_t offset, size_t count, uint32_t size = 30, uint32_t source = 1) {
    return reassembly_.add(source, {unit, offset, size, std::span(bytes_).subspan(offset % 1000, count)}, out_);
  }
  std::vector<uint8_t> bytes_ = numbers(5000);
  ByteBuffer out_;
  Reassembly reassembly_{{.bytes = 4000, .units = 3}};
};

TEST_F(ReassemblyTest, AnyOrder) {
  std::vector<uint32_t> offsets{0, 10, 20};
  do {
    EXPECT_EQ(add(1, offsets[0], 10), kKept);
    EXPECT_EQ(add(1, offsets[1], 10), kKept);
    EXPECT_EQ(add(1, offsets[2], 10), kComplete);
    EXPECT_TRUE(std::ranges::equal(out_, std::span(bytes_).first(30)));
    EXPECT_EQ(reassembly_.bytes(), 0u);
  } while (std::ranges::next_permutation(offsets).found);
  EXPECT_EQ(add(1, 0, 30), kComplete);
  EXPECT_EQ(reassembly_.dropped(), 0u);
}

TEST_F(ReassemblyTest, UnitsOfSeveralSendersAtOnce) {
  EXPECT_EQ(add(1, 0, 10, 20, 1), kKept);
  EXPECT_EQ(add(1, 0, 10, 20, 2), kKept);
  EXPECT_EQ(add(2, 0, 10, 20, 1), kKept);
  EXPECT_EQ(add(1, 10, 10, 20, 2), kComplete);
  EXPECT_EQ(add(2, 10, 10, 20, 1), kComplete);
  EXPECT_EQ(add(1, 10, 10, 20, 1), kComplete);
}

TEST_F(ReassemblyTest, ContradictionsAreRefused) {
  EXPECT_EQ(add(1, 10, 10), kKept);
  EXPECT_EQ(add(1, 10, 10), kDuplicate);
  EXPECT_EQ(add(1, 0, 10, 31), kBad);
  EXPECT_EQ(add(1, 10, 9), kBad);
  EXPECT_EQ(add(1, 10, 11), kBad);
  EXPECT_EQ(add(1, 0, 11), kBad);
  EXPECT_EQ(add(1, 5, 20), kBad);
  EXPECT_EQ(add(1, 19, 2), kBad);
  EXPECT_EQ(add(1, 12, 3), kBad);
  EXPECT_EQ(add(1, 0, 30), kBad);
  EXPECT_EQ(add(1, 0, 10), kKept);
  EXPECT_EQ(add(1, 20, 10), kComplete);
  EXPECT_TRUE(std::ranges::equal(out_, std::span(bytes_).first(30)));
}

TEST_F(ReassemblyTest, OldestUnitIsDropped) {
  for (uint16_t unit = 1; unit <= 4; unit++) EXPECT_EQ(add(unit, 0, 10), kKept);
  EXPECT_EQ(reassembly_.units(), 3u);
  EXPECT_EQ(reassembly_.dropped(), 1u);
  EXPECT_EQ(add(2, 10, 20), kComplete);
  EXPECT_EQ(add(1, 10, 20), kKept);  // starts again, without its first chunk
  reassembly_.clear();
  EXPECT_EQ(reassembly_.dropped(), 4u);
  EXPECT_EQ(reassembly_.bytes(), 0u);
}

TEST_F(ReassemblyTest, SizesAreBounded) {
  EXPECT_EQ(add(1, 0, 1, 4001), kTooLarge);
  EXPECT_EQ(add(1, 0, 1, UINT32_MAX), kTooLarge);
  EXPECT_EQ(add(1, UINT32_MAX - 1, 1, UINT32_MAX), kTooLarge);
  EXPECT_EQ(reassembly_.units(), 0u);
  std::mt19937 random(1);
  for (int i = 0; i < 20000; i++) {
    const uint32_t size = 12 + random() % 4000, offset = random() % size;
    add(static_cast<uint16_t>(random() % 6), offset, 1 + random() % std::min<uint32_t>(40, size - offset), size);
    ASSERT_LE(reassembly_.bytes(), 4000u);
    ASSERT_LE(reassembly_.units(), 3u);
  }
}

using wire::UnitKind;

// Numbered packets with the faults of a link applied.
struct OnWire {
  uint16_t sequence;
  uint32_t timestamp;
  Bytes payload;
};
using Link = std::vector<OnWire>;

class Sender {
 public:
  explicit Sender(UnitKind kind, size_t max_payload = 1388) : packetizer_(kind), max_payload_(max_payload) {}
  void send(const Bytes& unit) {
    time_ += 3000;
    for (const Sent& sent : packetize(packetizer_, unit, max_payload_))
      link.push_back({sequence_++, time_, sent.payload});
  }
  Link link;

 private:
  Packetizer packetizer_;
  size_t max_payload_;
  uint16_t sequence_ = 65500;
  uint32_t time_ = 0xffff0000;
};

class Receiver {
 public:
  explicit Receiver(UnitKind kind, const Reassembly::Limits& limits = {}) : depacketizer(kind, limits) {}
  void take(const Link& link, uint32_t source = 1) {
    for (const OnWire& packet : link)
      depacketizer.push({source, packet.sequence, packet.timestamp, packet.payload},
                        [&](std::span<const uint8_t> bytes, ByteBuffer* own) {
                          units.push_back(to_bytes(bytes));
                          EXPECT_TRUE(!own || bytes.data() == own->data());
                        });
  }
  Depacketizer depacketizer;
  std::vector<Bytes> units;
};

Link sent(UnitKind kind, const std::vector<Bytes>& units, size_t max_payload = 1388) {
  Sender sender(kind, max_payload);
  for (const Bytes& unit : units) sender.send(unit);
  return sender.link;
}

// Returns the numbers of all received fragments with repetitions, and the expected count.
std::vector<uint32_t> fragments_of(const std::vector<Bytes>& units, uint32_t* total = nullptr) {
  std::vector<uint32_t> numbers;
  for (const Bytes& unit : units) {
    const std::optional<wire::AnswerPartHeader> head = wire::parse_answer_header(unit);
    if (!head) continue;
    for (uint32_t i = 0; i < head->part.count; i++) numbers.push_back(head->part.first + i);
    if (total) *total = head->part.total;
  }
  std::ranges::sort(numbers);
  return numbers;
}

Bytes rich_answer() { return answer_with_sum(200, 120, true, 30); }

TEST(Depacketizer, ReceivesSentUnits) {
  uint32_t total = 0;
  Receiver receiver(UnitKind::kAnswer);
  const Link link = sent(UnitKind::kAnswer, {rich_answer()});
  receiver.take(link);
  const std::vector<uint32_t> numbers = fragments_of(receiver.units, &total);
  ASSERT_EQ(numbers.size(), total);
  for (uint32_t i = 0; i < total; i++) EXPECT_EQ(numbers[i], i);
  const Depacketizer::Stats stats = receiver.depacketizer.stats();
  EXPECT_EQ(stats.packets, link.size());
  EXPECT_EQ(stats.units, receiver.units.size());
  EXPECT_EQ(stats.lost + stats.duplicates + stats.bad_packets + stats.bad_chunks + stats.bad_units, 0u);

  Receiver chunks(UnitKind::kAnswer);
  const Bytes large = answer(1, 390, 390, 90);
  chunks.take(sent(UnitKind::kAnswer, {large, large}));
  EXPECT_EQ(chunks.units, (std::vector<Bytes>{large, large}));
  EXPECT_GT(chunks.depacketizer.stats().chunks, 6u);
}

using Damage = std::function<void(Link&, std::mt19937&)>;

// Faults and attacks, and the expected effect. Received units must always be valid.
struct Row {
  const char* name;
  Damage damage;
  bool all_come;                                     // every fragment arrives once
  bool none_twice;                                   // no fragment arrives twice
  uint64_t Depacketizer::Stats::*counted = nullptr;  // must count at least once
};

void flip(Bytes& bytes, size_t at, std::mt19937& random) { bytes[at] ^= static_cast<uint8_t>(1 << random() % 8); }

Damage of_each_payload(const std::function<void(Bytes&, std::mt19937&)>& change) {
  return [change](Link& link, std::mt19937& random) {
    for (OnWire& packet : link) change(packet.payload, random);
  };
}

void double_packets(Link& link) {
  const Link once = link;
  link.insert(link.end(), once.begin(), once.end());
}

const Row kRows[] = {
    {"nothing", [](Link&, std::mt19937&) {}, true, true},
    {"one lost", [](Link& link, std::mt19937& random) { link.erase(link.begin() + 1 + random() % (link.size() - 2)); },
     false, true, &Depacketizer::Stats::lost},
    {"half lost", [](Link& link, std::mt19937& random) { std::erase_if(link, [&](auto&) { return random() % 2; }); },
     false, true, &Depacketizer::Stats::lost},
    {"neighbours swapped",
     [](Link& link, std::mt19937&) {
       for (size_t i = 0; i + 1 < link.size(); i += 2) std::swap(link[i], link[i + 1]);
     },
     true, true},
    {"reversed", [](Link& link, std::mt19937&) { std::ranges::reverse(link); }, true, true},
    {"shuffled", [](Link& link, std::mt19937& random) { std::ranges::shuffle(link, random); }, true, true},
    {"doubled", [](Link& link, std::mt19937&) { double_packets(link); }, true, true, &Depacketizer::Stats::duplicates},
    {"doubled and shuffled",
     [](Link& link, std::mt19937& random) {
       double_packets(link);
       std::ranges::shuffle(link, random);
     },
     true, true, &Depacketizer::Stats::duplicates},
    {"cut short",
     of_each_payload([](Bytes& payload, std::mt19937& random) { payload.resize(random() % payload.size()); }), false,
     true, &Depacketizer::Stats::bad_units},
    {"overlong", of_each_payload([](Bytes& payload, std::mt19937&) { payload.insert(payload.end(), 100, 0x8f); }),
     false, true, &Depacketizer::Stats::bad_units},
    {"another version", of_each_payload([](Bytes& payload, std::mt19937&) { payload[0] += 0x10; }), false, true,
     &Depacketizer::Stats::bad_packets},
    {"an unknown kind", of_each_payload([](Bytes& payload, std::mt19937&) { payload[0] |= 0x0e; }), false, true,
     &Depacketizer::Stats::bad_packets},
    {"empty", of_each_payload([](Bytes& payload, std::mt19937&) { payload.clear(); }), false, true,
     &Depacketizer::Stats::bad_packets},
    {"flipped bits in front", of_each_payload([](Bytes& payload, std::mt19937& random) {
       flip(payload, random() % std::min<size_t>(payload.size(), 100), random);
     }),
     false, false},
    {"flipped bits anywhere",
     of_each_payload([](Bytes& payload, std::mt19937& random) { flip(payload, random() % payload.size(), random); }),
     false, false},
    {"noise", of_each_payload([](Bytes& payload, std::mt19937& random) {
       for (uint8_t& byte : payload) byte = static_cast<uint8_t>(random());
     }),
     false, true, &Depacketizer::Stats::bad_packets},
};

TEST(Depacketizer, HostileLinks) {
  std::mt19937 random(11);
  const std::vector<Bytes> answers{rich_answer(), answer(1, 390, 390, 90), answer(60, 40, 30, 75)};
  for (const Row& row : kRows) {
    for (const Bytes& unit : answers) {
      for (int round = 0; round < 4; round++) {
        Link link = sent(UnitKind::kAnswer, {unit}, round % 2 ? 1388 : 500);
        row.damage(link, random);
        Receiver receiver(UnitKind::kAnswer);
        receiver.take(link);
        for (const Bytes& got : receiver.units) {
          std::string reason;
          const std::optional<wire::UnitHeader> header = wire::peek_unit(got);
          ASSERT_TRUE(header && header->kind == UnitKind::kAnswer) << row.name;
          const bool known = header->version == wire::kVersion && header->type == wire::kFragmentsType;
          EXPECT_TRUE(!known || wire::parse_answer(got, &reason)) << row.name << ": " << reason;
        }
        uint32_t total = 0;
        const std::vector<uint32_t> numbers = fragments_of(receiver.units, &total);
        EXPECT_TRUE(!row.none_twice || std::ranges::adjacent_find(numbers) == numbers.end()) << row.name;
        EXPECT_TRUE(!row.all_come || (total > 0 && numbers.size() == total)) << row.name;
        receiver.depacketizer.clear();
        const Depacketizer::Stats stats = receiver.depacketizer.stats();
        EXPECT_EQ(stats.packets, link.size());
        if (row.all_come) {
          EXPECT_EQ(stats.lost, 0u) << row.name;
          EXPECT_EQ(stats.bad_packets + stats.bad_chunks + stats.bad_units, 0u) << row.name;
        }
        const uint64_t counted = row.counted ? stats.*row.counted + stats.bad_chunks + stats.incomplete_units : 1;
        EXPECT_TRUE(counted > 0 || link.size() < 5) << row.name;
      }
    }
  }
}

TEST(Depacketizer, LostPacketLosesOnlyItsContent) {
  const Link all = sent(UnitKind::kAnswer, {answer_with_sum(200, 120, true, 0)});
  for (size_t lost = 0; lost < all.size(); lost += 7) {
    Link link = all;
    link.erase(link.begin() + lost);
    Receiver receiver(UnitKind::kAnswer);
    receiver.take(link);
    uint32_t total = 0;
    const wire::AnswerPartHeader head = wire::parse_answer_header(std::span(all[lost].payload).subspan(2)).value();
    EXPECT_EQ(fragments_of(receiver.units, &total).size(), head.part.total - head.part.count);
  }
}

std::vector<uint32_t> sequences(const std::vector<Bytes>& units) {
  std::vector<uint32_t> out;
  for (const Bytes& unit : units) out.push_back(wire::decode_request(unit).value().sequence);
  return out;
}

Link sent_requests(uint32_t first, uint32_t count, uint32_t view_id = 0) {
  std::vector<Bytes> units;
  for (uint32_t i = 0; i < count; i++) units.push_back(request(first + i, view_id));
  return sent(UnitKind::kRequest, units);
}

std::vector<uint32_t> counted_up(uint32_t first, uint32_t count) {
  std::vector<uint32_t> out(count);
  for (uint32_t i = 0; i < count; i++) out[i] = first + i;
  return out;
}

TEST(Depacketizer, ToleratesTwoLostRequestPackets) {
  const Link all = sent_requests(UINT32_MAX - 10, 40);  // across the wrap-around of sequence numbers
  for (size_t lost = 0; lost + 2 < all.size(); lost++) {
    Link link = all;
    link.erase(link.begin() + lost, link.begin() + lost + 2);
    Receiver receiver(UnitKind::kRequest);
    receiver.take(link);
    EXPECT_EQ(sequences(receiver.units), counted_up(UINT32_MAX - 10, 40)) << lost;
  }
}

TEST(Depacketizer, RequestsAreDeliveredOnceAndInOrder) {
  Link link = sent_requests(1, 40);
  for (size_t i = 1; i + 1 < link.size(); i += 2) std::swap(link[i], link[i + 1]);
  const size_t n = link.size();
  for (size_t i = 0; i < n; i++) link.insert(link.begin() + 2 * i, link[2 * i]);
  Receiver receiver(UnitKind::kRequest);
  receiver.take(link);
  EXPECT_EQ(sequences(receiver.units), counted_up(1, 40));
  EXPECT_GT(receiver.depacketizer.stats().repeated, 60u);
  EXPECT_EQ(receiver.depacketizer.stats().duplicates, 40u);
}

TEST(Depacketizer, ViewsAndSendersAreIndependent) {
  Receiver receiver(UnitKind::kRequest);
  receiver.take(sent_requests(100, 5, 1), 7);
  receiver.take(sent_requests(50, 5, 1), 8);
  Sender sender(UnitKind::kRequest);
  for (uint32_t i = 0; i < 5; i++) {
    sender.send(request(i, 3));
    sender.send(request(200 + i, 4));
  }
  receiver.take(sender.link, 9);
  EXPECT_EQ(receiver.units.size(), 20u);
}

TEST(Depacketizer, AcceptsARestartedViewer) {
  Receiver receiver(UnitKind::kRequest);
  receiver.take(sent_requests(1000, 20));
  receiver.take(sent_requests(0, 20));    // packet numbers and times continue, requests restart at 0
  EXPECT_EQ(receiver.units.size(), 20u);  // indistinguishable from duplicates
  Link restarted = sent_requests(0, 20);
  for (OnWire& packet : restarted) packet.timestamp += 12345;
  receiver.take(restarted);
  EXPECT_EQ(receiver.units.size(), 40u);
  Link again = sent_requests(15, 20);
  for (OnWire& packet : again) packet.sequence = static_cast<uint16_t>(packet.sequence + 20000);
  receiver.take(again);
  EXPECT_EQ(sequences(receiver.units).back(), 34u);
  EXPECT_GE(receiver.units.size(), 58u);
}

TEST(Depacketizer, PassesUnitsOfFutureVersions) {
  Bytes unit = answer(1, 60, 60, 0);
  unit[4] = 9;
  Receiver receiver(UnitKind::kAnswer);
  receiver.take(sent(UnitKind::kAnswer, {unit}));
  EXPECT_EQ(receiver.units, std::vector<Bytes>{unit});
}

TEST(Depacketizer, DropsUnitsOfTheOtherKind) {
  Receiver receiver(UnitKind::kAnswer);
  receiver.take(sent_requests(1, 3));
  EXPECT_TRUE(receiver.units.empty());
  EXPECT_EQ(receiver.depacketizer.stats().bad_units, 3u);
}

TEST(Depacketizer, MemoryIsBounded) {
  const Reassembly::Limits limits{.bytes = 100000, .units = 8};
  Receiver receiver(UnitKind::kAnswer, limits);
  std::mt19937 random(5);
  for (int i = 0; i < 3000; i++) {
    Bytes payload(kChunkHeaderBytes + 1000, 0x55);
    put_chunk_header(payload.data(),
                     {static_cast<uint16_t>(random()), static_cast<uint32_t>(random() % 60000), 90000, {}});
    receiver.take({{static_cast<uint16_t>(i), 0, payload}}, random());
    put_chunk_header(payload.data(), {7, UINT32_MAX - 1000 - 1, UINT32_MAX, {}});
    receiver.take({{static_cast<uint16_t>(i), 0, payload}}, random());
  }
  const Depacketizer::Stats stats = receiver.depacketizer.stats();
  EXPECT_EQ(stats.units, 0u);
  EXPECT_EQ(stats.bad_chunks, 3000u);
  EXPECT_GE(stats.incomplete_units, 2992u);
  receiver.depacketizer.clear();
  EXPECT_EQ(receiver.depacketizer.stats().incomplete_units, 3000u);
}

}  // namespace
}  // namespace lf::rtp
