"""What is in a recording of the fleet: recording.py FILE.mcap  (pip install mcap jsonschema)"""
import json, sys
from collections import Counter
from jsonschema import Draft202012Validator
from mcap.reader import make_reader

topics, counts, wrong, validators = {}, Counter(), [], {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file)
    summary = reader.get_summary()
    for schema, channel, message in reader.iter_messages():
        if channel.id not in validators:
            text = json.loads(schema.data)
            Draft202012Validator.check_schema(text)
            validators[channel.id] = Draft202012Validator(text)
            topics[channel.topic] = schema.name
        counts[channel.topic] += 1
        for error in validators[channel.id].iter_errors(json.loads(message.data)):
            wrong.append(f"{channel.topic}: {error.json_path}: {error.message}")
    metadata = {entry.name: entry.metadata for entry in reader.iter_metadata()}
print(json.dumps({
    "topics": {topic: {"schema": topics[topic], "messages": counts[topic]} for topic in sorted(topics)},
    "messages": summary.statistics.message_count if summary and summary.statistics else None,
    "metadata": metadata,
    "wrong": wrong[:20],
}))
