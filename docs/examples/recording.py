"""What is in a recording of the fleet: recording.py FILE.mcap  (pip install mcap jsonschema)"""
import json, sys
from collections import Counter
from jsonschema import Draft202012Validator
from mcap.exceptions import McapError
from mcap.reader import NonSeekingReader, make_reader

topics, counts, wrong, validators = {}, Counter(), [], {}
summary, metadata, cut = None, {}, None
with open(sys.argv[1], "rb") as file:
    try:
        reader = make_reader(file)
        summary = reader.get_summary()
        metadata = {entry.name: entry.metadata for entry in reader.iter_metadata()}
    except McapError:  # killed before it was finished: its whole chunks can be read from the front
        file.seek(0)
        reader = NonSeekingReader(file)
    try:
        for schema, channel, message in reader.iter_messages(log_time_order=summary is not None):
            if channel.id not in validators:
                text = json.loads(schema.data)
                Draft202012Validator.check_schema(text)
                validators[channel.id] = Draft202012Validator(text)
                topics[channel.topic] = schema.name
            counts[channel.topic] += 1
            for error in validators[channel.id].iter_errors(json.loads(message.data)):
                wrong.append(f"{channel.topic}: {error.json_path}: {error.message}")
    except McapError as error:
        cut = str(error)
print(json.dumps({
    "topics": {topic: {"schema": topics[topic], "messages": counts[topic]} for topic in sorted(topics)},
    "messages": summary.statistics.message_count if summary and summary.statistics else None,
    "metadata": metadata,
    "wrong": wrong[:20],
    "cut": cut,
}))
